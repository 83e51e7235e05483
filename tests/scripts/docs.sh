#!/bin/sh
# README.md and docs/ show what the program prints: each block that begins with "$ build/pinwheel" is run, and its lines must
# be in the output, in their order.  Numbers agree to 1 %, or both are below 1e-6 in size, or the line depends on the machine:
# times, and results of a drifting method at a singular configuration.
# Tables of options are those that core/cli/options.sh makes.
# A YAML or CSV block after "save as `NAME`:" becomes a file for the commands after it.  Run from the top folder; reads PINWHEEL.

. "$(dirname "$0")/../support/report.sh"

# blocks FILE: for each, a line "# COMMAND" and the lines that are shown below it.
blocks () {
  awk '/^    \$ build\/pinwheel / { shown = 1; print "# " substr ($0, 22); next }
       NF && !/^    / { shown = 0 }
       shown && NF { print substr ($0, 5) }' "$1"
}

# files FILE: writes the YAML and CSV blocks that a page names, in $work.
files () {
  awk -v work="$work" '
    /[Ss]ave as `[^`]*`:$/ { name = $0; sub (/.*[Ss]ave as `/, "", name); sub (/`:$/, "", name) }
    /^```$/ && writing { close (work "/" name); writing = 0; name = "" }
    writing { print > (work "/" name) }
    /^```(yaml|csv)$/ && name != "" { writing = 1 }' "$1"
}

# missing FILE: the first line of standard input that is not in the file, after the lines before it; "..." is skipped.
missing () {
  awk -v file="$1" '
    function bare(word) { gsub (/[(),:;"]/, "", word); return word }
    function close_to(a, b, d) {
      d = a - b; if (d < 0) d = -d; if (a < 0) a = -a; if (b < 0) b = -b
      return d <= 0.01 * a || (a < 1e-6 && b < 1e-6) }
    function like(a, b, n, i, x, y, free) {
      free = a ~ /cpu_s|processor time|[0-9] %|lost at a singular configuration|\[ns\]|took/
      gsub (/=/, " = ", a); gsub (/=/, " = ", b) # --set omega=2.5
      n = split (a, x); if (split (b, y) != n) return 0
      for (i = 1; i <= n; i++) {
        x[i] = bare(x[i]); y[i] = bare(y[i])
        if (x[i] == y[i]) continue
        if (x[i] !~ /^[-+]?[0-9.]+(e[-+]?[0-9]+)?$/ || y[i] !~ /^[-+]?[0-9.]+(e[-+]?[0-9]+)?$/) return 0
        if (!free && !close_to(x[i] + 0, y[i] + 0)) return 0 }
      return 1 }
    BEGIN { while ((getline line < file) > 0) out[++lines] = line }
    $1 == "..." { next }
    { for (at++; at <= lines && !like($0, out[at]); at++);
      if (at > lines) { print "not printed: " $0; exit } }'
}

for page in README.md docs/*.md; do
  [ -z "$(blocks "$page")" ] && continue
  blocks "$page" >"$work/page"
  files "$page"
  grep -n '^# ' "$work/page" | while IFS=: read -r at command; do
    command=${command#\# }
    (cd "$work" && eval "\"$pinwheel\" $command" >out 2>&1 </dev/null)
    sed -n "$((at + 1)),\${/^# /q;p}" "$work/page" | missing "$work/out" >"$work/log"
    [ ! -s "$work/log" ]
    report "$page: pinwheel $command" $?
  done
done

for page in $(grep -l '^<!-- options of ' docs/*.md); do
  sh core/cli/options.sh "$pinwheel" "$page" | diff "$page" - >"$work/log"
  report "$page: tables of options, else make options" $?
done

models=$(find models -name '*.c' -o -name '*.yaml' | sed 's,.*/,,; s/\..*//' | sort)
echo "$models" >"$work/models"
sed -n 's/^### //p' docs/gallery.md | sort | diff "$work/models" - >"$work/log"
report "docs/gallery.md: every model" $?
echo "expected: gallery of $(echo "$models" | wc -l) models" >"$work/log"
tr '\n' ' ' <docs/changelog.md | grep -q "gallery of $(echo "$models" | wc -l) models"
report "docs/changelog.md: the number of models" $?
[ ! -e "$work/failed" ]
