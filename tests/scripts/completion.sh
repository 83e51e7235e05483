#!/bin/sh
# The shell's completion of commands, models, methods and options.  Reads PINWHEEL.

. "$(dirname "$0")/../support/report.sh"
command -v bash >/dev/null || { echo '# skipped: no bash'; exit 0; }

# complete WORD...: the completions of the last word
complete () {
  bash -c 'PATH=$(dirname "$0"):$PATH; . core/cli/completion.bash; COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); _pinwheel; echo "${COMPREPLY[@]}"' \
    "$pinwheel" "$@" >"$work/log" 2>&1
}

# expect NAME TEXT: the completions contain these words
expect () {
  for w in $2; do grep -q -E "(^| )$w( |\$)" "$work/log" || { report "$1" 1; return; }; done
  report "$1" 0
}

complete pinwheel co; expect 'a command' compare
complete pinwheel run ez; expect 'a model' ezyroller
complete pinwheel run ezyroller --method erk8+; expect 'a method' 'erk8.none erk8.projection erk8.nullspace'
complete pinwheel run ezyroller --ch; expect 'an option' '--checkpoint --checkpoint-every'
complete pinwheel compare ezyroller --method-f; expect 'an option of a file' '--method-file'
complete pinwheel compare ezyroller --method-file docs/meth; expect 'its file' docs/method.c
complete pinwheel list k; expect 'a list' kinds
complete pinwheel run ezyroller -o READ; expect 'a file' README.md
exit $bad
