# SPDX-License-Identifier: MIT
# cmake -DLINKER= -DOBJCOPY= -DNM= -DOBJDUMP= -DKEEP= -DOUT= -DOBJECTS= -P this
# Joins OBJECTS, which are compiled for other instructions than the rest of a program, into OUT, an
# object that defines no name for the rest but KEEP.
#
# Inline functions and templates (of the standard library, say) are in every object that uses them,
# and a linker keeps one for all callers. It must not be one that an older processor cannot run. So
# the groups that let it choose are dissolved, and all names but KEEP become local.
function(run)
  execute_process(COMMAND ${ARGN} OUTPUT_VARIABLE out ERROR_VARIABLE errors RESULT_VARIABLE failed)
  if(failed)
    file(REMOVE ${OUT})
    list(JOIN ARGN " " command)
    message(FATAL_ERROR "${command}\n${errors}")
  endif()
  set(out "${out}" PARENT_SCOPE)
endfunction()

function(leaks what)
  file(REMOVE ${OUT})
  message(FATAL_ERROR "${OUT} ${what}")
endfunction()

run(${LINKER} -r --force-group-allocation -o ${OUT}.joined ${OBJECTS})
run(${OBJCOPY} --keep-global-symbol=${KEEP} ${OUT}.joined ${OUT})
file(REMOVE ${OUT}.joined)

# What the tools left is checked, whichever they are.
run(${NM} --extern-only --defined-only --format=posix ${OUT})
string(REGEX MATCHALL "[^\n]+" symbols "${out}")
foreach(symbol IN LISTS symbols)
  if(NOT symbol MATCHES "^${KEEP} T ")
    leaks("defines a name for the rest of the program: ${symbol}")
  endif()
endforeach()
list(LENGTH symbols count)
if(NOT count EQUAL 1)
  leaks("does not define ${KEEP}")
endif()
run(${OBJDUMP} --section-headers ${OUT})
if(out MATCHES "[.](preinit_array|init_array|ctors|group)[^\n]*")
  leaks("has code that runs at the start of every program, or groups: ${CMAKE_MATCH_0}")
endif()
