# SPDX-License-Identifier: MIT
# One binary for several instruction sets. Sets KERF_CAN_DISPATCH where compiler, linker and flags
# can, else KERF_NO_DISPATCH to the reason; kerf_add_variants() does it.
set(KERF_ISOLATE ${CMAKE_CURRENT_LIST_DIR}/isolate.cmake)
set(KERF_VARIANT_baseline -march=x86-64)
set(KERF_VARIANT_avx2 -march=x86-64-v3)
set(KERF_VARIANT_avx512 -march=x86-64-v4)
set(KERF_ISOLATION_FOLDER ${CMAKE_BINARY_DIR}/CMakeFiles/dispatch)

# The command that makes one object `out`, with the one name `keep`, from `objects`.
function(kerf_isolate_command command out keep objects)
  string(REPLACE ";" "\\;" objects "${objects}")
  set(${command} ${CMAKE_COMMAND} -DLINKER=${CMAKE_LINKER} -DOBJCOPY=${CMAKE_OBJCOPY} -DNM=${CMAKE_NM}
    -DOBJDUMP=${CMAKE_OBJDUMP} -DKEEP=${keep} -DOUT=${out} "-DOBJECTS=${objects}" -P ${KERF_ISOLATE}
    PARENT_SCOPE)
endfunction()

# Whether two objects that share an inline function can be joined and kept apart. Not so with the
# sanitizers, for one: their objects announce themselves at the start of a program.
function(kerf_check_isolation result)
  set(folder ${KERF_ISOLATION_FOLDER})
  file(WRITE ${folder}/shared.hpp
    "#include <string>\n#include <vector>\ninline std::string a(int n) { return std::string(n, 'a'); }\n")
  file(WRITE ${folder}/one.cpp "#include \"shared.hpp\"\nstd::string b(int n) { return a(n) + 'b'; }\n")
  file(WRITE ${folder}/two.cpp "#include \"shared.hpp\"\nstd::string b(int);\n"
    "extern \"C\" int probe(int n) { return int((a(n) + b(n)).size()); }\n")
  set(${result} OFF PARENT_SCOPE)
  separate_arguments(flags NATIVE_COMMAND "${CMAKE_CXX_FLAGS}")
  foreach(name one two)
    execute_process(COMMAND ${CMAKE_CXX_COMPILER} ${flags} ${KERF_VARIANT_avx512} -fno-lto
      -c ${name}.cpp -o ${name}.o
      WORKING_DIRECTORY ${folder} RESULT_VARIABLE failed OUTPUT_QUIET ERROR_VARIABLE error)
    file(WRITE ${folder}/error.txt "${error}")
    if(failed)
      return()
    endif()
  endforeach()
  kerf_isolate_command(command ${folder}/joined.o probe "${folder}/one.o;${folder}/two.o")
  execute_process(COMMAND ${command} RESULT_VARIABLE failed OUTPUT_QUIET ERROR_VARIABLE error)
  file(WRITE ${folder}/error.txt "${error}")
  if(failed)
    return()
  endif()
  set(${result} ON PARENT_SCOPE)
endfunction()

set(KERF_CAN_DISPATCH OFF)
set(KERF_NO_DISPATCH "")
get_property(multi_config GLOBAL PROPERTY GENERATOR_IS_MULTI_CONFIG)
include(CheckCXXSourceCompiles)
check_cxx_source_compiles("int main() {
  return __builtin_cpu_supports(\"x86-64-v3\") + __builtin_cpu_supports(\"x86-64-v4\"); }"
  KERF_HAS_CPU_LEVELS)
if(NOT CMAKE_SYSTEM_PROCESSOR MATCHES "^(x86_64|AMD64|amd64)$")
  set(KERF_NO_DISPATCH "it has no others that Kerf knows")
elseif(multi_config)
  set(KERF_NO_DISPATCH "${CMAKE_GENERATOR} builds several configurations at once")
elseif(NOT KERF_HAS_CPU_LEVELS)
  set(KERF_NO_DISPATCH "the compiler does not know x86-64-v3 and -v4, as GCC does from 12 on")
else()
  set(how "${CMAKE_CXX_COMPILER} ${CMAKE_CXX_FLAGS} ${CMAKE_LINKER} ${CMAKE_OBJCOPY}")
  if(NOT KERF_ISOLATION_TRIED STREQUAL how)
    kerf_check_isolation(isolates)
    set(KERF_ISOLATES ${isolates} CACHE INTERNAL "")
    set(KERF_ISOLATION_TRIED "${how}" CACHE INTERNAL "")
  endif()
  if(KERF_ISOLATES)
    set(KERF_CAN_DISPATCH ON)
  else()
    set(KERF_NO_DISPATCH "code for others cannot be kept apart, see ${KERF_ISOLATION_FOLDER}/error.txt")
  endif()
endif()

# kerf_compile_for(target variant): in place of what the tree is compiled for.
function(kerf_compile_for target variant)
  get_target_property(options ${target} COMPILE_OPTIONS)
  list(FILTER options EXCLUDE REGEX "-march=native")
  list(APPEND options ${KERF_VARIANT_${variant}})
  set_target_properties(${target} PROPERTIES COMPILE_OPTIONS "${options}")
endfunction()

# kerf_add_variants(TARGET VARIANTS variants... SOURCES sources... [OPTIONS options...]): compiles
# the sources for each variant, and adds to the target an object for each that defines
# kerf_fast_<variant> and nothing else.
function(kerf_add_variants target)
  cmake_parse_arguments(ARG "" "" "VARIANTS;SOURCES;OPTIONS" ${ARGN})
  foreach(variant IN LISTS ARG_VARIANTS)
    set(objects ${target}_${variant})
    add_library(${objects} OBJECT ${ARG_SOURCES})
    # Link-time optimisation would leave no code yet, and names that are unique in a program (those
    # of static variables in templates) cannot become local.
    set_target_properties(${objects} PROPERTIES INTERPROCEDURAL_OPTIMIZATION OFF)
    target_compile_options(${objects} PRIVATE -fno-lto $<$<CXX_COMPILER_ID:GNU>:-fno-gnu-unique;-Wno-psabi>
      ${ARG_OPTIONS})
    kerf_compile_for(${objects} ${variant})
    target_compile_definitions(${objects} PRIVATE KERF_FAST_FACTORY=kerf_fast_${variant})
    target_link_libraries(${objects} PRIVATE kerf_core OpenMP::OpenMP_CXX kerf_warnings)
    set(out ${CMAKE_CURRENT_BINARY_DIR}/${target}_${variant}.o)
    kerf_isolate_command(command ${out} kerf_fast_${variant} "$<TARGET_OBJECTS:${objects}>")
    add_custom_command(OUTPUT ${out} COMMAND ${command} DEPENDS $<TARGET_OBJECTS:${objects}> ${KERF_ISOLATE}
      COMMENT "Keeping the code for ${variant} apart" VERBATIM)
    set_source_files_properties(${out} PROPERTIES EXTERNAL_OBJECT ON GENERATED ON)
    target_sources(${target} PRIVATE ${out})
  endforeach()
endfunction()
