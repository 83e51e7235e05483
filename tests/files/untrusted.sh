#!/bin/sh
# Text models of unfriendly people: however they are made, they read nothing outside their folder, run nothing, and end with
# an error in words, in little time and memory (2 GB of addresses are all they get).
# Run from the top folder; reads PINWHEEL.

. "$(dirname "$0")/../support/report.sh"
mkdir "$work/in" && cd "$work/in" || exit 1

# refused NAME TEXT: standard input is a model after its first line; it is refused with the text in the message.
refused () {
  { echo 'pinwheel: 1'; cat; } >model.yaml
  (ulimit -v 2000000; exec timeout 100 "$pinwheel" show ./model.yaml) >out 2>"$work/log"
  [ $? = 2 ] && grep -q "$2" "$work/log"
  report "$1" $?
}

# many COUNT FORMAT: a line for each number
many () { awk -v n="$1" -v f="$2\n" 'BEGIN { for (i = 0; i < n; i++) printf f, i, i }'; }
# across COUNT TEXT: the text so many times, on one line
across () { awk -v n="$1" -v f="$2" 'BEGIN { for (i = 0; i < n; i++) printf "%s", f; print "" }'; }

body='bodies: [{name: a, mass: 1, inertia: 1}]'
signal () { printf '%s\nelements:\n  - {torque: t, body: [a, ground], value: %s}\n' "$body" "$1"; }

# ---- Memory and time ----

{ printf 'bodies: '; across 100000 '['; } | refused 'lists in lists' 'nested too deeply'
{ printf 'bodies: '; across 100000 '{a: '; } | refused 'maps in maps' 'nested too deeply'
printf 'a: &a [x,x]\nb: &b [*a,*a]\nc: [*b,*b]\n' | refused 'a billion laughs' 'anchors (&) do not belong'
{ printf 'parameters: [{name: p, value: "'; across 50000 '1+' | tr -d '\n'; echo '1"}]'; } |
  refused 'a long expression' 'more than 4000 characters'
{ printf 'parameters: [{name: p, value: "'; across 1500 '(' | tr -d '\n'; echo '1"}]'; } |
  refused 'parentheses in parentheses' 'too many parentheses'
{ echo 'bodies:'; many 1000001 '  - {name: b%d}'; } | refused 'a million bodies' '1000001 entries; a model may have 1000000'
sum=$(across 1900 '+t')
{ echo "$body"; echo 'elements:'; many 8000 "  - {torque: t%d, body: [a, ground], value: $sum}"; } |
  refused 'many long signals' 'have more than 30000000 operations'
{ echo t,v; many 100000 '%d,%d'; } >table.csv
{ echo "$body"; echo 'elements:'
  many 300 '  - {torque: t%d, body: [a, ground], value: {table: {file: table.csv, columns: [t, v]}}}'; } |
  refused 'a table read again and again' 'have more than 20000000 points'
{ echo 'paths:'; many 300 '  - {name: p%d, file: table.csv}'; } | refused 'a path read again and again' \
  'have more than 20000000 points'
many 1000001 '%d,%d' >table.csv
echo 'paths: [{name: p, file: table.csv}]' | refused 'a path of a million points' '1000001 points; a path may have 1000000'
many 4000001 '%d,%d' >table.csv
signal '{table: {file: table.csv}}' | refused 'a large table' 'table.csv'

# ---- What is not the model's ----

printf '0,1\n1,2\n' >../secret.csv
ln -s ../secret.csv link.csv
ln -s /dev/zero zero.csv
mkfifo pipe.csv
ln -s .. up
for name in ../secret.csv "$work/secret.csv" link.csv zero.csv pipe.csv up/secret.csv ./up/../../secret.csv /etc/passwd; do
  signal "{table: {file: \"$name\"}}" | refused "a table in $name" 'cannot read'
  echo "paths: [{name: p, file: \"$name\"}]" | refused "a path in $name" 'cannot read'
done
printf '#include <stdlib.h>\n__attribute__ ((constructor)) static void f (void) { system ("touch ran"); }\n' >evil.c
for line in 'plugin: ./evil.so' 'kinds: [evil.c]' 'include: evil.yaml' 'about: !!python/object:os.system [x]' '<<: *x'; do
  printf '%s\n%s\n' "$line" "$body" | refused "$line" 'error: '
done
signal '"system(1)"' | refused 'a call' 'there is no "system"'
signal '"a.phi = 1"' | refused 'an assignment' 'would assign'

# ---- The current directory ----

# Whatever lies there is not taken, nor preferred, unless it is named by a path.
cc -shared -fPIC -o ezyroller.so evil.c 2>/dev/null && cp ezyroller.so libpinwheel.so && cp ezyroller.so libpinwheel.so.0
printf 'pinwheel: 1\n%s\n' "$body" >mine.yaml
cp mine.yaml ezyroller.yaml
"$pinwheel" show ezyroller >out 2>"$work/log" && grep -q steer out && ! "$pinwheel" show mine >out 2>"$work/log" &&
  "$pinwheel" show ./mine.yaml >out 2>"$work/log" && ! "$pinwheel" list | grep -q mine && [ ! -e ran ]
report 'nothing is taken from the current directory' $?
[ ! -e "$work/failed" ]
