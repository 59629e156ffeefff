# fuzz/fuzz_NAME.c: a libFuzzer program a reader. Its seeds are written by a program too, fuzz/make_NAME_seeds.c: no
# binary files in git.
if(NOT CMAKE_C_COMPILER_ID MATCHES "Clang")
  message(FATAL_ERROR "RIFFLE_FUZZ needs clang: cmake --preset sanitizers")
endif()
# What readers run reports the paths taken, too: without that the fuzzers grope in the dark. The rest does not: no fuzzer
# gets there, and the tests, which share these objects, would take two to three times as long.
set(RIFFLE_TRACED_SOURCES ${RIFFLE_SOURCES})
list(FILTER RIFFLE_TRACED_SOURCES INCLUDE REGEX "/src/(core|data|in)/")
set_property(SOURCE ${RIFFLE_TRACED_SOURCES} APPEND PROPERTY COMPILE_OPTIONS -fsanitize=fuzzer-no-link)

file(GLOB RIFFLE_FUZZ_SOURCES CONFIGURE_DEPENDS fuzz/fuzz_*.c)
foreach(source ${RIFFLE_FUZZ_SOURCES})
  get_filename_component(name ${source} NAME_WE)
  add_executable(${name} ${source})
  target_compile_definitions(${name} PRIVATE _GNU_SOURCE)
  target_compile_options(${name} PRIVATE -fsanitize=fuzzer)
  target_link_options(${name} PRIVATE -fsanitize=fuzzer)
  target_include_directories(${name} PRIVATE src)
  target_link_libraries(${name} PRIVATE riffle_static)
endforeach()

file(GLOB RIFFLE_SEED_SOURCES CONFIGURE_DEPENDS fuzz/make_*.c)
foreach(source ${RIFFLE_SEED_SOURCES})
  get_filename_component(name ${source} NAME_WE)
  add_executable(${name} ${source})
  target_compile_definitions(${name} PRIVATE _GNU_SOURCE)
  target_include_directories(${name} PRIVATE src tests)
  target_link_libraries(${name} PRIVATE riffle_test_support riffle_static ZLIB::ZLIB)
endforeach()
