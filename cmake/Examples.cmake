# examples/*.c: each one program in BUILD/examples that sees the public headers alone.
file(GLOB RIFFLE_EXAMPLE_SOURCES CONFIGURE_DEPENDS examples/*.c)
foreach(source ${RIFFLE_EXAMPLE_SOURCES})
  get_filename_component(name ${source} NAME_WE)
  add_executable(${name} ${source})
  target_compile_definitions(${name} PRIVATE _GNU_SOURCE)
  target_link_libraries(${name} PRIVATE riffle_static m)
  set_target_properties(${name} PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/examples)
endforeach()

if(BUILD_TESTING)
  # The README's lines of C are those of examples/texture.c, and that program runs.
  add_test(NAME the_lines_of_c_in_the_readme_are_those_of_the_example
           COMMAND bash ${CMAKE_SOURCE_DIR}/tests/install/compare_readme.sh ${CMAKE_SOURCE_DIR})
  file(MAKE_DIRECTORY ${CMAKE_BINARY_DIR}/examples/frames)
  add_test(NAME the_example_of_the_readme_runs COMMAND texture WORKING_DIRECTORY ${CMAKE_BINARY_DIR}/examples/frames)
  add_test(NAME the_tables_in_the_docs_are_what_the_program_says
           COMMAND bash ${CMAKE_SOURCE_DIR}/cmake/doc_tables.sh $<TARGET_FILE:options>)
endif()
