/* Functions written once for a constant size and compiled for each, so that their loops vanish. */
#ifndef PW_UNROLL_H
#define PW_UNROLL_H

/* Before a loop whose length, at most 8, is a constant once its function is inlined.  Clang needs no telling. */
#if defined(__GNUC__) && !defined(__clang__)
#define PW_UNROLL _Pragma ("GCC unroll 8")
#else
#define PW_UNROLL
#endif

/* In the place of `static` of such a function. */
#if defined(__GNUC__)
#define PW_INLINE static inline __attribute__ ((always_inline))
#else
#define PW_INLINE static inline
#endif

/* In the place of `static` of a function beside a shorter and more frequent way through its caller, which then need not save
 * what this one uses. */
#if defined(__GNUC__)
#define PW_NOINLINE static __attribute__ ((noinline))
#else
#define PW_NOINLINE static
#endif

/* At the top of a file that reads pairs of numbers which were stored one by one: read as one vector, they would have
 * to wait until the stores are done. */
#if defined(__GNUC__) && !defined(__clang__)
#define PW_ONE_BY_ONE _Pragma ("GCC optimize (\"no-tree-slp-vectorize\")")
#else
#define PW_ONE_BY_ONE
#endif

#endif
