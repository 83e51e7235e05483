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

# ---- Copies and included files ----

copy () { printf '  - {repeat: {i: %s}, %s}\n' "$1" "$2"; }
{ echo 'bodies:'; copy 1e5+1 'name: "b{i}"'; } | refused 'more than 100,000 copies' 'expected a whole number from 0 to 100000'
{ echo 'bodies:'; for x in $(many 21 b%d_); do copy 1e5 "name: \"$x{i}\""; done; } |
  refused 'two million bodies' 'more than 2000000 entries'
{ echo 'let:'; for x in $(many 21 b%d_); do copy 1e5 "\"$x{i}\": i"; done; } | refused 'two million numbers' 'more than 2000000 entries'
{ echo 'states:'; for x in $(many 21 b%d_); do copy 1e5 "name: \"$x{i}\", rate: 1"; done; } |
  refused 'two million states' 'more than 2000000 entries'
{ printf 'elements:\n  - repeat: {i: 1e5}\n    list:\n'; many 1000 '      - {torque: "t{i}_%d", body: [a, ground], value: 1}'; echo "$body"; } |
  refused 'copies of a long list' 'more than 2000000 entries'
{ printf 'elements:\n  - {torque: T, body: [a, ground], value: w.z}\n  - repeat: {i: 1e5}\n    list:\n'
  many 1000 '      - {pin: "t{i}_%d"}'; echo "$body"; } | refused 'a search in many elements' 'more than 2000000 elements'
text=$(across 3900 1 | tr -d '\n')
{ echo 'bodies:'; copy 1e5 "name: \"b{i}\", mass: \"0.{i}$text\""; copy 1e5 "name: \"c{i}\", mass: \"0.{i}$text\""; } |
  refused 'long texts in copies' 'have texts of more than 400 MB'
{ echo 'bodies:'; copy 1e5 "name: \"b{$(across 1900 +1 | tr -d '\n')}\""; } | refused 'a long expression in braces' 'copies have the same name'
{ echo 'bodies:'; copy 9 'list: [{repeat: {j: 9}, name: "b{i}"}]'; } | refused 'copies in copies' 'inside another repeat'
printf 'pinwheel: 1\n' >leaf.yaml
for i in 1 2 3 4 5 6; do
  { echo 'pinwheel: 1'; echo 'include:'; many 50 "  - {file: $([ $i = 1 ] && echo leaf || echo f$((i - 1))).yaml, prefix: a%d}"; } >f$i.yaml
done
printf 'include: [{file: f6.yaml}]\n' | refused 'a billion files' 'more than 1000, the limit'
{ echo 'pinwheel: 1'; echo 'include:'; copy 1e5 'file: leaf.yaml'; } >g1.yaml
{ echo 'pinwheel: 1'; echo 'include:'; copy 1e5 'file: g1.yaml'; } >g2.yaml
{ echo 'include:'; copy 1e5 'file: g2.yaml'; } | refused 'copies of files with copies' 'more than 2000000 entries'
for i in 1 2 3 4 5 6 7 8 9; do printf 'pinwheel: 1\ninclude: [{file: d%d.yaml}]\n' $((i + 1)) >d$i.yaml; done
cp leaf.yaml d10.yaml
printf 'include: [{file: d1.yaml}]\n' | refused 'files in files' 'at most 8 deep'
printf 'include: [{file: model.yaml}]\n' | refused 'a model that includes itself' 'includes itself'
ln -s model.yaml again.yaml
printf 'include: [{file: ./again.yaml}]\n' | refused 'a model that includes itself by a link' 'includes itself'
{ printf 'pinwheel: 1\n#'; across 30000000 x | tr -d '\n'; echo; } >big.yaml
printf 'include: [{file: big.yaml}, {file: big.yaml, prefix: b}, {file: big.yaml, prefix: c}]\n' |
  refused 'many large files' 'limit for a model'

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
printf 'pinwheel: 1\nbodies: [{name: secret}]\n' >../secret.yaml
ln -s ../secret.yaml link.yaml
for name in ../secret.yaml "$work/secret.yaml" link.yaml up/secret.yaml ./up/../../secret.yaml /etc/passwd; do
  printf 'include: [{file: "%s"}]\n' "$name" | refused "an included file $name" 'cannot read'
done
for name in zero.csv pipe.csv; do
  printf 'include: [{file: "%s"}]\n' "$name" | refused "an included file $name" 'cannot '
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
