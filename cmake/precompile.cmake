# SPDX-License-Identifier: MIT
# kerf_precompile(target headers...): headers from outside that most of its sources include are read
# once. Not with a compiler cache, which does not see into such a file; there each source is compiled
# with its own includes only.
set(KERF_STANDARD_HEADERS <algorithm> <array> <cmath> <cstdint> <filesystem> <functional> <map> <memory>
  <numeric> <span> <sstream> <string> <unordered_map> <vector>)
function(kerf_precompile target)
  if(NOT CMAKE_CXX_COMPILER_LAUNCHER)
    target_precompile_headers(${target} PRIVATE ${KERF_STANDARD_HEADERS} ${ARGN})
  endif()
endfunction()

# kerf_compile_together(target count): so many sources at a time, where reading what they include
# takes longer than compiling what they do. Not with a compiler cache either.
function(kerf_compile_together target count)
  if(NOT CMAKE_CXX_COMPILER_LAUNCHER)
    set_target_properties(${target} PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE ${count})
  endif()
endfunction()
