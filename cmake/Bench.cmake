# bench/*.c and evaluation/*.c: each one program, FOLDER_NAME, linked against the static library and what tests share.
# With sanitizers their times would mean nothing.
if(TARGET riffle_test_support AND NOT RIFFLE_SANITIZE)
  file(GLOB RIFFLE_BENCH_SOURCES CONFIGURE_DEPENDS RELATIVE ${CMAKE_SOURCE_DIR} bench/*.c evaluation/*.c)
endif()
foreach(source ${RIFFLE_BENCH_SOURCES})
  string(REGEX REPLACE "/(.*)\\.c$" "_\\1" name ${source})
  add_executable(${name} ${source})
  target_compile_definitions(${name} PRIVATE _GNU_SOURCE RF_SOURCE_DIR="${CMAKE_SOURCE_DIR}")
  target_link_libraries(${name} PRIVATE riffle_test_support kissfft::kissfft)
endforeach()
