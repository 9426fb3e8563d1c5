/* $title; see $own_header. Written by wavesweep $version. */
#include <float.h>

#include "$own_header"

#if defined(__FAST_MATH__) || defined(__ASSOCIATIVE_MATH__) || defined(__RECIPROCAL_MATH__)
#error "the compiler may reorder arithmetic: compile controller.c without -ffast-math, -Ofast and their parts"
#endif
#if defined(FLT_EVAL_METHOD) && FLT_EVAL_METHOD != 0
#error "doubles are computed with excess precision: compile controller.c with -msse2 -mfpmath=sse"
#endif
@if single
#if FLT_MANT_DIG != 24 || FLT_MAX_EXP != 128
#error "the type is not the IEEE format of 32 bits, for which the bounds are"
@else
#if DBL_MANT_DIG != 53 || DBL_MAX_EXP != 1024
#error "double is not the IEEE format of 64 bits; there is no build with the same bits"
@end
#endif
#if defined(__FMA__) || defined(__FMA4__) || defined(__AVX512F__) || defined(__FP_FAST_FMA)
#ifndef WS_ALLOW_FMA
#error "fused multiplications are on (-march=native?): compile controller.c with -mno-fma -mno-fma4 -mno-avx512f. On a \
processor that always has them, such as ARM, add -ffp-contract=off -DWS_ALLOW_FMA if `make check` passes with just these flags"
#endif
#endif
#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#endif
