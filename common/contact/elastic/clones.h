// SPDX-License-Identifier: Apache-2.0
// clones.h — one function compiled for several instruction sets, chosen when the program starts.
#pragma once

// The same operations in the same order on every set (no fused multiply-add: -ffp-contract=off), so
// results are equal to the bit. A sanitizer is not ready when the choice is made; Clang and other
// processors than x86-64 get their baseline.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && \
    !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define PALPATE_CLONES __attribute__((target_clones("arch=x86-64-v4", "arch=x86-64-v3", "default")))
#else
#define PALPATE_CLONES
#endif
