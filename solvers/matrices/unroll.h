/* Attributes and pragmas that control unrolling, inlining and vectorisation. */
#ifndef PW_UNROLL_H_
#define PW_UNROLL_H_

/* Before a loop whose length, at most 8, is constant after inlining.  Clang unrolls it without a pragma. */
#ifndef __clang__
#define PW_UNROLL _Pragma ("GCC unroll 8")
#else
#define PW_UNROLL
#endif

/* Replaces `static` of a function that is compiled once per set of constant arguments, such as a size. */
#define PW_INLINE static inline __attribute__ ((always_inline))

/* At the top of a file that reads pairs of numbers shortly after storing them one by one: a vector load would stall
 * until both stores are complete. */
#ifndef __clang__
#define PW_ONE_BY_ONE _Pragma ("GCC optimize (\"no-tree-slp-vectorize\")")
#else
#define PW_ONE_BY_ONE
#endif

#endif
