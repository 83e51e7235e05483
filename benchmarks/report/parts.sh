# Part of report.sh: the original algorithm, drift, long runs, effects and programs by hand.

# ---- The original algorithm ----

csvo=$results/original-$machine.csv
if [ -f "$csvo" ] && [ -f "$csv" ]; then
  awk -F, '
    FNR == 1 { next }
    NR == FNR { gap[$1] = $2 - $3; if (gap[$1] < 0) gap[$1] = -gap[$1]; next }
    $1 == "original" && $7 == "ok" { h = $6 + 0; e[h, $4 ~ /held/] = $11; o[h, $4 ~ /held/] = $15; b[h, $4 ~ /held/] = $18; if (!(h in seen)) { seen[h] = 1; order[++n] = h } }
    END { print "| step [s] | torque held: error [m] | order | work by rectangles: gap [J] | torque at stage times: error [m] | order | work as a state: gap [J] |"; print "|---|---|---|---|---|---|---|"
      for (i = 1; i <= n && order[i] > 0.002; i++) { h = order[i]; g = ""; for (k in gap) if (k / h > 0.999 && k / h < 1.001) g = sprintf ("%.2g", gap[k])
        printf "| %g | %.2g | %s | %s | %.2g | %s | %.2g |\n", h, e[h, 1], o[h, 1] == "nan" ? "" : sprintf ("%.2f", o[h, 1]), g, e[h, 0], o[h, 0] == "nan" ? "" : sprintf ("%.2f", o[h, 0]), b[h, 0] } }
  ' "$csvo" "$csv" | section original
  for m in rk4+projection:metric=identity:inputs=held rk4+projection; do
    awk -F, -v m="$m" '$1 == "original" && $4 == m && $7 == "ok" { print $6, $11 }' "$csv" >"$work/$m"
  done
  awk -F, 'NR > 1 { g = $2 - $3; print $1, g < 0 ? -g : g }' "$csvo" >"$work/gap"
  awk -F, '$1 == "original" && $4 == "rk4+projection" && $7 == "ok" { print $6, $18 }' "$csv" >"$work/balance"
  draw bench-original 480 'The original algorithm: error and energy gap against the step' <<G
set logscale xy; set format '10^{%T}'; set xlabel 'step [s]'; set key at graph 0.5,screen (1 - 16/height) center top vertical samplen 3
eval panel(left, 0.5*width - 14, 44, height - bottom)
set ylabel 'largest error of a length over 100 s [m]'
plot '$work/rk4+projection:metric=identity:inputs=held' using 1:2 with linespoints lw 1 pt 4 dt (10,4) lc rgb '#cc6677' title 'torque held over a step, as originally', \
     '$work/rk4+projection' using 1:2 with linespoints lw 1 pt 7 dt 1 lc rgb '#004488' title 'torque at stage times'
set ylabel 'work against kinetic energy [J]'
eval panel(0.5*width + left - 4, width - right, 44, height - bottom)
plot '$work/gap' with linespoints lw 1 pt 4 dt (10,4) lc rgb '#cc6677' title 'work by rectangles, as originally', \
     '$work/balance' with linespoints lw 1 pt 7 dt 1 lc rgb '#004488' title 'work as a state of the integration'
G
fi

# ---- Drift ----

csvd=$results/drift-$machine.csv
if [ -f "$csvd" ]; then
  awk -F, '
    function power(x) { return x == "nan" ? "" : sprintf ("t^%.1f", x < 0.05 ? 0 : x) }
    BEGIN { print "| method | residual of position | grows | of velocity | grows | energy defect [J] | grows |"; print "|---|---|---|---|---|---|---|" }
    NR > 1 && $6 == "ok" && $1 == "methods" {
      printf "| `%s` | %.1e | %s | %.1e | %s | %.1e | %s |\n", $2, $8, power($10), $11, power($13), $14, power($16) }' "$csvd" | section drift
fi

# ---- Long runs ----

# Energy of the contact oscillator over 10^5 periods; problem 1: reversible, 2: perturbed.
csvl=$(ls "$results"/long-*.csv)
if [ -f "$csvl" ]; then
  awk -F, '
    NR == 1 { next }
    { key = $1 SUBSEP $2; if (!($2 in seen)) { seen[$2] = 1; method[++n] = $2 }
      if ($4 > most[key]) most[key] = $4; if ($3 < 314160 && $4 > early[key]) early[key] = $4 }
    function defect(problem, m,  k, p) { k = problem SUBSEP m; p = log(most[k] / early[k]) / log(2)
      return sprintf("%.2g", most[k]) (p < 0.1 ? " | |" : sprintf(" | t^%.1f |", p)) }
    END { print "| largest energy defect [J] | reversible | grows | perturbed | grows |"; print "|---|---|---|---|---|"
      for (i = 1; i <= n; i++) printf "| `%s` | %s %s\n", method[i], defect("reversible", method[i]), defect("perturbed", method[i]) }' "$csvl" | section long
  for problem in reversible perturbed; do
    for m in leapfrog galpha+ggl rk4+projection radau; do
      awk -F, -v p=$problem -v m=$m '$1 == p && $2 == m { print $3 / 6.283185307, $4 }' "$csvl" >"$work/$problem-$m"
    done
  done
  lines () {
    echo "plot '$work/$1-leapfrog' with lines lw 1.5 lc rgb '#117755' dt (8,4) title 'leapfrog', '$work/$1-galpha+ggl' with lines lw 1.5 lc rgb '#8844aa' dt (10,4,3,4) title 'galpha+ggl',\\"
    echo " '$work/$1-rk4+projection' with lines lw 1.5 lc rgb '#004488' dt 1 title 'rk4+projection', '$work/$1-radau' with lines lw 1.5 lc rgb '#000000' dt (3,3) title 'radau'"
  }
  draw bench-long 430 'Contact oscillator: largest energy defect of a part of the run against time' <<G
set logscale xy; set format '10^{%T}'; set xlabel 'time [periods of the carriage]'; set key top left
set xrange [500:1e5]; set yrange [1e-3:30]
eval panel(left, 0.5*width - 14, 24, height - bottom)
set ylabel 'energy defect, reversible [J]'
$(lines reversible)
set ylabel 'energy defect, perturbed [J]'
eval panel(0.5*width + left - 4, width - right, 24, height - bottom)
$(lines perturbed)
G
fi

# ---- Effects ----

text=$results/effects-$machine.txt
if [ -f "$text" ]; then { echo '```'; sed 's/^all kinds:.*/all kinds/' "$text"; echo '```'; } | section effects; fi

# ---- Against programs by hand of the same kind ----

csvp=$results/peers-$machine.csv
if [ -f "$csvp" ]; then
  awk -F'"' '
    function ratio(x) { return x > 0 ? sprintf ("%.2f", x) : "" }
    BEGIN { print "| method | program by hand | by hand [ms] | Pinwheel [ms] | ratio | evaluations | instructions per evaluation |"
            print "|---|---|---|---|---|---|---|" }
    NR > 1 { split ($1, m, ","); split ($3, v, ",") # error, times, evaluations, instructions
      if (v[2] != 1e-6 || !(v[3] > 0 && v[4] > 0) || m[1] ~ /nullspace|fixed|adams.baumgarte/) next
      printf "| `%s` | %s | %s | %s | %s | %s | %s |\n", m[1], $2, v[3], v[4], ratio(v[4] / v[3]), ratio(v[5] > 0 ? v[6] / v[5] : 0), ratio(v[7] > 0 ? v[8] / v[7] : 0) }' "$csvp" | section peers
fi
