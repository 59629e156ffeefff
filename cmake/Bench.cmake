# bench/*.c: each one program, linked against the static library and the shared scenes in tests/support.
# With sanitizers their times would mean nothing.
if(TARGET riffle_test_support AND NOT RIFFLE_SANITIZE)
  file(GLOB RIFFLE_BENCH_SOURCES CONFIGURE_DEPENDS bench/*.c)
endif()
foreach(source ${RIFFLE_BENCH_SOURCES})
  get_filename_component(name ${source} NAME_WE)
  add_executable(bench_${name} ${source})
  target_compile_definitions(bench_${name} PRIVATE _GNU_SOURCE)
  target_link_libraries(bench_${name} PRIVATE riffle_test_support)
endforeach()
