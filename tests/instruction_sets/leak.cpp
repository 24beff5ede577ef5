// SPDX-License-Identifier: MIT
//
// What a file of the hot loops must not have: an object with external code at the start.
#include <string>

std::string name_of_the_machine(64, 'x');

extern "C" std::size_t kerf_fast_avx2() { return name_of_the_machine.size(); }
