// INVAR_WIDE_VECTORS: before a function whose loops are worth being compiled for wider vectors, too; the one that the CPU
// has is chosen when the program is loaded. Only for whole numbers, or sums that are kept in lanes of their own: results
// must not depend on the CPU.
#pragma once

#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__SANITIZE_ADDRESS__) && \
    !defined(__SANITIZE_THREAD__)
#define INVAR_WIDE_VECTORS __attribute__((target_clones("avx2", "default")))
#elif defined(__GNUC__) && !defined(__clang__)
// With the check for overflow GCC 12 computes other numbers from vectors, where addresses are checked, too (-O3).
#define INVAR_WIDE_VECTORS __attribute__((no_sanitize("signed-integer-overflow")))
#else
#define INVAR_WIDE_VECTORS
#endif
