# Part of report.sh: tables and figures of work and precision.

csv=$results/work-precision-$machine.csv

# Costs of the methods shown with the general engine: group, scene, engine, method, unit, times.
costs () {
  awk -f benchmarks/report/costs.awk "$csv" >"$work/costs"
  for m in $shown; do awk -F '\t' -v m="$m" '$3 == "general" && $4 == m' "$work/costs"; done >"$work/shown"
}

# Costs relative to the cheapest method of a scene: group, method, scene, digits, ratio.
relative () {
  awk -F '\t' '
    { for (k = 1; k <= 3; k++) if ($(5 + k) != "-" && (!(($2, k) in least) || $(5 + k) < least[$2, k])) least[$2, k] = $(5 + k) }
    { line[NR] = $0 }
    END { for (n = 1; n <= NR; n++) { split(line[n], c, "\t")
        for (k = 1; k <= 3; k++) if ((c[2], k) in least)
          print c[1] "\t" c[4] "\t" c[2] "\t" 3 * k "\t" (c[5 + k] == "-" ? "-" : c[5 + k] / least[c[2], k]) } }' "$work/shown" >"$work/relative"
}

# The median and the maximum of these relative costs in each group of scenes.
summary_table () {
  awk -F '\t' -v methods="$shown" '
    function cell(g, m, k,  n, i, j, t, v) {
      n = split(value[g, m, k], v, " ")
      for (i = 2; i <= n; i++) for (j = i; j > 1 && v[j] + 0 < v[j - 1] + 0; j--) { t = v[j]; v[j] = v[j - 1]; v[j - 1] = t }
      if (n == 0) return "-"
      t = n % 2 ? v[(n + 1) / 2] : sqrt(v[n / 2] * v[n / 2 + 1])
      return sprintf("%s%s (%s)%s", t < 1.05 ? "**" : "", round(t) (t < 1.05 ? "**" : ""), round(v[n]), n < all[g, m, k] ? " " n "/" all[g, m, k] : "")
    }
    function round(x) { return sprintf(x < 9.95 ? "%.1f" : "%.0f", x) }
    { all[$1, $2, $4]++; if ($5 != "-") value[$1, $2, $4] = value[$1, $2, $4] " " $5 }
    END { split("smooth stiff singular", group, " "); n = split(methods, m, " ")
      print "| method | smooth, 1e-3 | 1e-6 | 1e-9 | stiff, 1e-3 | 1e-6 | 1e-9 | change points, 1e-6 |"; print "|---|---|---|---|---|---|---|---|"
      for (i = 1; i <= n; i++) { printf "| `%s` |", m[i]
        for (g = 1; g <= 2; g++) for (k = 3; k <= 9; k += 3) printf " %s |", cell(group[g], m[i], k)
        print " " cell("singular", m[i], 6) " |" } }' "$work/relative"
}

# Costs for an error of 1e-6, relative to the cheapest method: a line for each method, a mark for each scene.
summary_figure () {
  n=0 labels=
  for m in $shown; do
    n=$((n + 1)) labels="$labels${labels:+, }'$m' -$n"
    for g in smooth stiff; do
      awk -F '\t' -v g=$g -v m="$m" -v n=$n '$1 == g && $2 == m && $4 == 6 && $5 != "-" { print $5, -n }' "$work/relative" >>"$work/strip-$g"
    done
  done
  draw bench-methods 480 'Processor time for an error of 1e-6, relative to the cheapest method' <<G
set logscale x; set format x '10^{%T}'; unset key; set grid; set xrange [0.8:*]; set yrange [-$n.5:-0.5]
set xlabel 'processor time / that of the cheapest method'
set ytics ($labels)
eval panel(left + 62, 0.5*width + 24, 44, height - bottom)
set title 'smooth motions' offset 0,-0.7
plot '$work/strip-smooth' with points pt 6 ps 0.7 lw 1 lc rgb '#004488'
set ytics -$n,1,-1; set format y ''
eval panel(0.5*width + left - 10, width - right, 44, height - bottom)
set title 'stiff scenes' offset 0,-0.7
plot '$work/strip-stiff' with points pt 6 ps 0.7 lw 1 lc rgb '#cc6677'
G
}

# Processor times for an error of 1e-6 in every scene, and the uncertainty of the reference solution.
work_table () {
  awk -F '\t' -v methods="$shown" -v file="$results/reference-$machine.csv" '
    BEGIN { m = split(methods, method, " ")
      while ((getline line < file) > 0) { split(line, q, "\""); split(q[1], a, ","); split(q[3], b, ","); known[a[1]] = b[3] > 0 ? b[3] : b[4] }
      printf "| scene | reference |"; for (i = 1; i <= m; i++) printf " `%s` |", method[i]; print ""
      printf "|---|---|"; for (i = 1; i <= m; i++) printf "---|"; print "" }
    !($2 in seen) { seen[$2] = ++scenes; scene[scenes] = $2; unit[$2] = $5 }
    { time[$2, $4] = $7; if ($7 != "-" && (!($2 in least) || $7 + 0 < least[$2])) least[$2] = $7 + 0 }
    END { for (s = 1; s <= scenes; s++) { printf "| %s | %.0e %s |", scene[s], known[scene[s]], unit[scene[s]]
        for (i = 1; i <= m; i++) { t = time[scene[s], method[i]]
          cell = t == "-" || t == "" ? "-" : sprintf(t < 1 ? "%.2f" : t < 10 ? "%.1f" : "%.0f", t)
          if (t != "-" && t + 0 == least[scene[s]]) cell = "**" cell "**"
          printf " %s |", cell }
        print "" } }' "$work/shown"
}

# One panel per scene, in rows of three.
work_figure () {
  scenes=$(awk -F '\t' '!seen[$2]++ { print $2 }' "$work/shown")
  n=$(echo "$scenes" | wc -l) rows=$(((n + 2) / 3)) i=0
  height=$((140 + 240 * rows))
  {
    echo "set logscale xy; set format '10^{%T}'; unset key; set xtics 10; set ytics 100"
    for scene in $scenes; do
      column=$((i % 3)) row=$((i / 3)) i=$((i + 1)) last=$((n - i < 3))
      echo "set lmargin at screen $(awk "BEGIN { print 0.085 + 0.318 * $column }"); set rmargin at screen $(awk "BEGIN { print 0.332 + 0.318 * $column }")"
      echo "set tmargin at screen $(awk "BEGIN { print 1 - (112 + 240 * $row) / $height }"); set bmargin at screen $(awk "BEGIN { print 1 - (112 + 178 + 240 * $row) / $height }")"
      unit=$(awk -F '\t' -v s="$scene" '$2 == s { print $5; exit }' "$work/shown")
      echo "set title '$scene [$unit]' offset 0,-0.7"
      [ $column = 0 ] && echo "set ylabel 'largest error' offset 0.8,0" || echo 'unset ylabel'
      [ $last = 1 ] && echo "set xlabel 'processor time [s]' offset 0,0.4" || echo 'unset xlabel'
      plot=
      for m in $shown; do
        awk -F, -v s="$scene" -v m="$m" '
          NR == 1 { for (i = 1; i <= NF; i++) at[$i] = i; next }
          { e = $at["largest_length"] == "nan" ? $at["largest_angle"] : $at["largest_length"] }
          $at["scene"] == s && $at["engine"] == "general" && $at["method"] == m && $at["status"] == "ok" && e > 0 && e < 10 { print $at["cpu"], e }' \
          "$csv" >"$work/$scene $m"
        [ -s "$work/$scene $m" ] && plot="$plot${plot:+, }'$work/$scene $m' with linespoints lw 0.8 ps 0.4 $(style "$m")"
      done
      awk '{ if (!n++) { a = b = $1; c = d = $2 } if ($1 < a) a = $1; if ($1 > b) b = $1; if ($2 < c) c = $2; if ($2 > d) d = $2 }
        END { printf "set xrange [%g:%g]; set yrange [%g:%g]\n", a / 1.4, b * 1.4, c / 4, d * 4 }' "$work/$scene "*
      echo "plot $plot"
    done
    echo "unset title; unset xlabel; unset ylabel; set border 0; unset tics; unset grid"
    echo "set lmargin at screen 0.05; set rmargin at screen 0.95; set tmargin at screen $(awk "BEGIN { print 1 - 34 / $height }"); set bmargin at screen $(awk "BEGIN { print 1 - 82 / $height }")"
    echo "set key center center horizontal maxcols 5 samplen 4; set xrange [1:2]; set yrange [1:2]"
    plot=
    for m in $shown; do plot="$plot${plot:+, }NaN with linespoints lw 0.8 ps 0.5 $(style "$m") title '$m'"; done
    echo "plot $plot"
  } | draw bench-work-precision "$height" 'What accuracy costs, scene by scene'
}

if [ -f "$csv" ]; then
  costs
  relative
  summary_table | section summary
  summary_figure
  work_table | section work-precision
  work_figure
fi
