#!/bin/sh
# Instructions per step against those of benchmarks/steps.txt: `make bench-check`.
#
#   check.sh PROGRAM [few] [update]
#
# few: only the rows marked *.  update: writes the counts into the file.  Fails if a step has grown by more than 3 %, and
# names it.  Callgrind counts the instructions of two runs that differ in their final time alone: counts do not depend on
# the load of the machine, but on the compiler.  With another one than that of the file they are shown and not compared.
set -eu
program=$1 few= update=
shift
for word; do eval "$word=1"; done
file=benchmarks/steps.txt compiler=$(${CC:-cc} --version | head -1)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
trap 'exit 130' INT TERM
if ! valgrind --version >/dev/null 2>&1; then
  echo "bench-check: skipped, since valgrind is not installed"
  exit 0
fi

# count FILE T MODEL OPTION...: a run to the time T; writes its steps and instructions.
count () {
  out=$1 end=$2
  shift 2
  valgrind --tool=callgrind --callgrind-out-file="$work/$out" "$program" run "$@" -t "$end" --json - >"$work/$out.json" \
    2>"$work/$out.errors" || { cat "$work/$out.errors" >&2; exit 1; }
  echo "$(sed -n 's/^ *"steps": *\([0-9]*\),*$/\1/p' "$work/$out.json" | head -1) $(sed -n 's/^summary: *//p' "$work/$out")"
}

sed -n '/^#/p' "$file" | sed "s|^# Compiler: .*|# Compiler: $compiler|" >"$work/new"
compared=1
[ -n "$update" ] || grep -qxF "# Compiler: $compiler" "$file" || compared=
grown=
while read -r mark committed from to command; do
  case $mark in '#'* | '') continue ;; esac
  [ -z "$few" ] || [ "$mark" = '*' ] || continue
  # A first run compiles specialised code, which the others find in the cache.
  # shellcheck disable=SC2086
  case $command in *always*) count first "$from" $command >/dev/null ;; esac
  # shellcheck disable=SC2086
  now=$(echo "$(count a "$from" $command) $(count b "$to" $command)" | awk '{ printf "%.0f", ($4 - $2) / ($3 - $1) }')
  printf '%s %7d %-3s %-3s %s\n' "$mark" "$now" "$from" "$to" "$command" >>"$work/new"
  change=$(awk -v a="$committed" -v b="$now" 'BEGIN { printf "%.1f", (a > 0 ? 100 * (b / a - 1) : 0) }')
  printf '%8d instead of %8d, %6s %%  %s\n' "$now" "$committed" "$change" "$command"
  case $change in -* | [0-2].* | 3.0) ;; *) grown="$grown
  $command: $now instructions per step instead of $committed" ;; esac
done <"$file"
if [ -n "$update" ]; then
  [ -n "$few" ] || cp "$work/new" "$file"
elif [ -z "$compared" ]; then
  echo "bench-check: not compared, since $compiler is not the compiler of $file"
elif [ -n "$grown" ]; then
  echo "bench-check: more than 3 % dearer:$grown"
  exit 1
fi
