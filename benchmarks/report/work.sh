# The part of report.sh about work and precision.

csv=$results/work-precision-$machine.csv
present () {
  for m in $shown; do cut -d, -f2 "$csv" | grep -qxF "$m" && echo "$m"; done
  return 0
}

# The least processor time of a level whose largest error is no more than the target, in ms.
work_table () {
  methods=$(present | paste -sd' ' -)
  awk -F, -v methods="$methods" '
    function milli(x) { return x < 0 ? "-" : sprintf (x < 1e-3 ? "%.2f" : x < 1e-2 ? "%.1f" : "%.0f", 1e3 * x) }
    BEGIN { m = split (methods, method, " "); target[1] = 1e-3; target[2] = 1e-6; target[3] = 1e-9
      printf "| scene |"; for (i = 1; i <= m; i++) printf " `%s` |", method[i]; print ""
      printf "|---|"; for (i = 1; i <= m; i++) printf "---|"; print "" }
    NR == 1 || $1 == "original" { next }
    !($1 in seen) { seen[$1] = ++scenes; scene[scenes] = $1 }
    { error = $9 == "nan" ? $10 : $9; if ($9 == "nan" && $10 != "nan") angles[$1] = 1 }
    $5 == "ok" && error != "nan" {
      for (k = 1; k <= 3; k++) if (error + 0 <= target[k]) {
        key = $1 SUBSEP $2 SUBSEP k
        if (!(key in best) || $21 < best[key]) best[key] = $21 } }
    END { for (s = 1; s <= scenes; s++) {
        printf "| %s%s |", scene[s], scene[s] in angles ? " (rad)" : ""
        for (k = 1; k <= 3; k++) { least[k] = -1
          for (i = 1; i <= m; i++) { key = scene[s] SUBSEP method[i] SUBSEP k
            if (key in best && (least[k] < 0 || best[key] < least[k])) least[k] = best[key] } }
        for (i = 1; i <= m; i++) { text = ""
          for (k = 1; k <= 3; k++) { key = scene[s] SUBSEP method[i] SUBSEP k
            value = key in best ? best[key] : -1
            cell = milli(value); if (value >= 0 && value == least[k]) cell = "**" cell "**"
            text = text (k > 1 ? " / " : "") cell }
          printf " %s |", text }
        print "" } }' "$csv"
}

# Methods none of whose levels has reached the end, and those some of whose have failed.
failure_table () {
  echo '| scene | method | levels that reach the end | why the others do not (the first of them) |'
  echo '|---|---|---|---|'
  awk -F, '
    NR == 1 || $1 == "original" { next }
    { key = $1 SUBSEP $2; if (!(key in all)) { order[++n] = key }; all[key]++
      if ($5 == "ok") good[key]++
      else if (($5 == "failed" || $5 == "refused") && !(key in why)) { why[key] = $0; for (i = 1; i < 23; i++) sub (/^[^,]*,/, "", why[key]) } }
    END { for (i = 1; i <= n; i++) { key = order[i]; if (!(key in why)) continue
        split (key, part, SUBSEP); gsub (/^"|"$/, "", why[key]); gsub (/\|/, "/", why[key])
        printf "| %s | `%s` | %d of %d | %s |\n", part[1], part[2], good[key], all[key], why[key] } }' "$csv"
}

truth_table () {
  echo '| scene | errors are against | which is known to [m] | [rad] |'
  echo '|---|---|---|---|'
  awk -F'"' 'NR > 1 { split ($1, a, ","); split ($3, b, ","); printf "| %s | %s | %s | %s |\n", a[1], $2, (b[3] > 0 ? b[3] : "not compared"), (b[4] > 0 ? b[4] : "not compared") }' "$results/truth-$machine.csv"
}

# One panel per scene, four rows of three.
work_figure () {
  scenes=$(awk -F, 'NR > 1 && $1 != "original" && !($1 in seen) { seen[$1] = 1; print $1 }' "$csv")
  n=$(echo "$scenes" | wc -l) rows=$(((n + 2) / 3)) i=0
  height=$((140 + 240 * rows))
  {
    echo "set logscale xy; set format '10^{%T}'; unset key; set xtics 10; set ytics 100"
    for scene in $scenes; do
      column=$((i % 3)) row=$((i / 3)) i=$((i + 1)) last=$((n - i < 3))
      echo "set lmargin at screen $(awk "BEGIN { print 0.085 + 0.318 * $column }"); set rmargin at screen $(awk "BEGIN { print 0.345 + 0.318 * $column }")"
      echo "set tmargin at screen $(awk "BEGIN { print 1 - (112 + 240 * $row) / $height }"); set bmargin at screen $(awk "BEGIN { print 1 - (112 + 178 + 240 * $row) / $height }")"
      unit=$(awk -F, -v s="$scene" '$1 == s && $5 == "ok" { print $9 == "nan" ? " [rad]" : " [m]"; exit }' "$csv")
      echo "set title '$scene$unit' offset 0,-0.7"
      [ $column = 0 ] && echo "set ylabel 'largest error' offset 0.8,0" || echo 'unset ylabel'
      [ $last = 1 ] && echo "set xlabel 'processor time [s]' offset 0,0.4" || echo 'unset xlabel'
      plot=
      for m in $(present); do
        awk -F, -v s="$scene" -v m="$m" '{ e = $9 == "nan" ? $10 : $9 } $1 == s && $2 == m && $5 == "ok" && e > 0 && e < 10 { print $21, e }' "$csv" >"$work/$scene $m"
        [ -s "$work/$scene $m" ] && plot="$plot${plot:+, }'$work/$scene $m' with linespoints lw 0.8 ps 0.4 $(style "$m")"
      done
      awk '{ if (!n++) { a = b = $1; c = d = $2 } if ($1 < a) a = $1; if ($1 > b) b = $1; if ($2 < c) c = $2; if ($2 > d) d = $2 }
        END { printf "set xrange [%g:%g]; set yrange [%g:%g]\n", a / 1.4, b * 1.4, c / 4, d * 4 }' "$work/$scene "*
      echo "plot $plot"
    done
    echo "unset title; unset xlabel; unset ylabel; set border 0; unset tics; unset grid"
    echo "set lmargin at screen 0.05; set rmargin at screen 0.95; set tmargin at screen $(awk "BEGIN { print 1 - 34 / $height }"); set bmargin at screen $(awk "BEGIN { print 1 - 82 / $height }")"
    echo "set key center center horizontal maxcols 4 samplen 4; set xrange [1:2]; set yrange [1:2]"
    plot=
    for m in $(present); do plot="$plot${plot:+, }NaN with linespoints lw 0.8 ps 0.5 $(style "$m") title '$m'"; done
    echo "plot $plot"
  } | draw bench-work-precision "$height" 'What accuracy costs, scene by scene'
}

if [ -f "$csv" ]; then
  work_table | section work-precision
  failure_table | section failures
  truth_table | section truth
  work_figure
fi
