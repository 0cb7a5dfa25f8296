// SPDX-License-Identifier: Apache-2.0
// session_reference_writer SET FILE: writes docs/session.md from a descriptor set of the schema.
#include <cstdio>
#include <exception>
#include <fstream>
#include <iterator>

#include "common/session/reference/session_reference.h"

int main(int argc, char** argv) {
  if (argc != 3) {
    std::fputs("usage: session_reference_writer DESCRIPTOR_SET FILE\n", stderr);
    return 2;
  }
  try {
    std::ifstream in(argv[1], std::ios::binary);
    const std::string set{std::istreambuf_iterator<char>(in), {}};
    std::ofstream out(argv[2], std::ios::binary);
    out << palpate::session_reference(set);
    out.close();
    if (in && out) return 0;
    std::fprintf(stderr, "%s or %s: cannot be read or written\n", argv[1], argv[2]);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s: %s\n", argv[1], error.what());
  }
  return 1;
}
