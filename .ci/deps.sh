#!/bin/sh
# Finds the libraries and programs that Pinwheel needs, and installs those that are missing by apt; without apt, it lists all.
#
#   deps.sh [fresh] [style] [browser] [slurm] [reference] [page] [python] [counts]
#
# fresh: ignore the last result, which is kept in BUILD.  The other words add tools: style: clang and clang-format; browser: a
# headless one, for the tests of pages; slurm: for tests/scripts/slurm.sh; reference: Python's numpy and scipy, for
# tests/reference/reference.sh; page: a compiler for WebAssembly, for interactive pages; python: for tests of the package; counts:
# valgrind, for `make bench-check`.
#
# Reads CC, CPPFLAGS, LDFLAGS, BUILD, NO_DEPS.

CC=${CC:-cc} BUILD=${BUILD:-build}
[ -z "$NO_DEPS" ] || { echo "deps: skipped (NO_DEPS=$NO_DEPS)"; exit 0; }

fresh= needs='cc sundials suitesparse lapacke libfyaml popt gsl nlopt cmocka gnuplot'
for word; do
  case $word in
  fresh) fresh=1 ;;
  style) needs="$needs clang clang-format" ;;
  browser) needs="$needs chromium" ;;
  slurm) needs="$needs slurmctld munged" ;;
  reference) needs="$needs python3-numpy python3-scipy" ;;
  python)
    needs="$needs python3-numpy python3-pytest python3-matplotlib python3-jsonschema python3-pycparser python3-pandas python3-xarray"
    needs="$needs python3-distributed python3-mpi4py python3-mypy" ;;
  counts) needs="$needs valgrind" ;;
  page) needs="$needs clang wasm-ld wasi-libc wasi-builtins" ;;
  *) echo "deps.sh: unknown word \"$word\"" >&2; exit 2 ;;
  esac
done

# The last good result is valid as long as the words, the compiler, its flags and this script are the same.
key="$needs | $CC | $CPPFLAGS | $LDFLAGS" good=$BUILD/deps.ok
if [ -z "$fresh" ] && [ -f "$good" ] && [ "$(cat "$good")" = "$key" ] && [ -z "$(find "$0" -newer "$good")" ]; then
  exit 0
fi

work=$(mktemp -d) || exit 1
trap 'rm -rf "$work"' EXIT
trap 'exit 130' INT TERM

# ---- A test program for each library ----

source_of () {
  case $1 in
  sundials) cat <<'C' ;;
#include <idas/idas.h>
#include <cvodes/cvodes.h>
#include <arkode/arkode_erkstep.h>
#include <nvector/nvector_serial.h>
int try_sundials (void) { return SUNContext_Create && IDASetEtaFixedStepBounds && CVodeInit && ERKStepCreate && N_VNew_Serial; }
C
  suitesparse) cat <<'C' ;;
#include <klu.h>
#include <amd.h>
int try_suitesparse (void) { return klu_defaults && klu_l_defaults && amd_order && amd_l_order && btf_maxtrans; }
C
  lapacke) cat <<'C' ;;
#include <lapacke.h>
int try_lapacke (void) { return LAPACKE_dgeev_work && LAPACKE_dgesvj_work; }
C
  libfyaml) cat <<'C' ;;
#include <libfyaml.h>
int try_libfyaml (void) { return fy_document_build_from_string && fy_node_report; }
C
  popt) cat <<'C' ;;
#include <popt.h>
int try_popt (void) { return poptGetContext && poptGetNextOpt; }
C
  gsl) cat <<'C' ;;
#include <gsl/gsl_multifit_nlinear.h>
int try_gsl (void) { return gsl_multifit_nlinear_alloc && gsl_multifit_nlinear_default_parameters; }
C
  nlopt) cat <<'C' ;;
#include <nlopt.h>
int try_nlopt (void) { return nlopt_create && nlopt_optimize; }
C
  cmocka) cat <<'C' ;;
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
int try_cmocka (void) { return _cmocka_run_group_tests != 0; }
C
  esac
}

libs_of () {
  case $1 in
  sundials) echo -lsundials_idas -lsundials_cvodes -lsundials_arkode -lsundials_nvecserial ;;
  suitesparse) echo -lklu -lamd -lbtf ;;
  libfyaml) echo -lfyaml ;;
  gsl) echo -lgsl -lgslcblas ;;
  *) echo "-l$1" ;;
  esac
}

# links LIBRARY...: succeeds if the test programs of these libraries compile, link and run; without output.
links () {
  libs=
  {
    for l; do source_of "$l"; libs="$libs $(libs_of "$l")"; done
    echo 'int main (void) { return'
    for l; do echo "  !try_$l () ||"; done
    echo '  0; }'
  } >"$work/try.c"
  $CC -w $CPPFLAGS "$work/try.c" -o "$work/try" $LDFLAGS $libs -lm >"$work/log" 2>&1 && "$work/try" >>"$work/log" 2>&1
}

# Sets $missing.  All libraries are tried at once, and one by one only if that fails.
look () {
  missing= libraries=
  for n in $needs; do
    case $n in
    cc) links || missing="$missing $n" ;;
    gnuplot | clang | clang-format | chromium | wasm-ld | valgrind) command -v "$n" >/dev/null || missing="$missing $n" ;;
    wasi-libc) [ -f /usr/include/wasm32-wasi/stdio.h ] || missing="$missing $n" ;;
    wasi-builtins) ls /usr/lib/llvm-*/lib/clang/*/lib/wasi/libclang_rt.builtins-wasm32.a >/dev/null 2>&1 || missing="$missing $n" ;;
    slurmctld | munged) [ -x "/usr/sbin/$n" ] || missing="$missing $n" ;;
    python3-*) "${PYTHON:-/usr/bin/python3}" -c "import ${n#python3-}" 2>/dev/null || missing="$missing $n" ;;
    *) libraries="$libraries $n" ;;
    esac
  done
  links $libraries && return
  for n in $libraries; do links "$n" || missing="$missing $n"; done
}

# ---- Packages ----

package_of () {
  case $1 in
  cc) echo gcc libc6-dev ;;
  gnuplot) echo gnuplot-nox ;;
  clang | clang-format | chromium | valgrind | python3-* | wasi-libc) echo "$1" ;;
  wasm-ld) echo lld ;;
  wasi-builtins) echo libclang-rt-14-dev-wasm32 ;;
  libfyaml) echo libfyaml-dev ;;
  slurmctld) echo slurm-wlm ;;
  munged) echo munge ;;
  *) echo "lib$1-dev" ;;
  esac
}

# compose SUDO: sets $command, which installs $packages; the package lists are updated only if $update is set.
compose () {
  command="${1}env DEBIAN_FRONTEND=noninteractive apt-get install -q -y --no-install-recommends $packages"
  [ -z "$update" ] || command="${1}apt-get update -q && $command"
}

# ---- The work ----

look
if [ -z "$missing" ]; then
  mkdir -p "$BUILD" && echo "$key" >"$good"
  [ -z "$fresh" ] || echo "deps: everything is there"
  exit 0
fi
echo "deps: missing:$missing"

if ! command -v apt-get >/dev/null; then
  echo "deps: no apt here: please install what is missing of a C compiler, SUNDIALS (6.2 or later), SuiteSparse, LAPACKE," \
    "libfyaml, popt, GSL, NLopt, cmocka and gnuplot, with their headers; then say NO_DEPS=1" >&2
  exit 1
fi

packages=
for n in $missing; do packages="$packages $(package_of "$n")"; done
packages=${packages# } update=
apt-cache show $packages >/dev/null 2>&1 || update=1

sudo=
command -v sudo >/dev/null && sudo='sudo '
if [ "$(id -u)" = 0 ]; then
  as=
elif [ -t 0 ] && [ -n "$sudo" ]; then
  as=$sudo
else
  compose "$sudo"
  echo "deps: not root, and no terminal or no sudo to ask with; please run as root:" >&2
  echo "  $command" >&2
  exit 1
fi

compose "$as"
echo "deps: $command"
if ! sh -c "$command"; then
  # Package lists that are out of date name files the server no longer has.
  [ -z "$update" ] || exit 1
  update=1
  compose "$as"
  echo "deps: $command"
  sh -c "$command" || exit 1
fi

look
if [ -n "$missing" ]; then
  echo "deps: still missing after installing:$missing" >&2
  case $missing in *sundials*) echo "deps: SUNDIALS must be 6.2 or later" >&2 ;; esac
  sed 's/^/  /' "$work/log" | head -20 >&2
  exit 1
fi
mkdir -p "$BUILD" && echo "$key" >"$good"
