# The parts of report.sh about the program by hand, the original algorithm, drift and effects.

# ---- Against an 8th-order program by hand ----

csv8=$results/eighth-$machine.csv
if [ -f "$csv8" ]; then
  awk -F, '
    BEGIN { print "| steering | program | 1e-6 m [ms] | erk8+projection takes | 1e-9 m [ms] | erk8+projection takes |"; print "|---|---|---|---|---|---|" }
    NR > 1 { if (!(($1, $2) in seen)) { seen[$1, $2] = 1; order[++n] = $1 SUBSEP $2 } }
    $3 == "line" { time[$1, $2, $5 < 1e-7] = 1e3 * $6 }
    END { for (i = 1; i <= n; i++) { split (order[i], p, SUBSEP); printf "| %s | %s |", p[1], p[2]
        for (k = 0; k < 2; k++) { t = time[p[1], p[2], k]
          if (t > 0) printf " %.3g | %.2g times that |", t, time[p[1], "erk8+projection", k] / t; else printf " never | |" }
        print "" } }' "$csv8" | section eighth
fi

# ---- The original algorithm ----

csvo=$results/original-$machine.csv
if [ -f "$csvo" ] && [ -f "$csv" ]; then
  awk -F, '
    FNR == 1 { next }
    NR == FNR { gap[$1] = $2 - $3; if (gap[$1] < 0) gap[$1] = -gap[$1]; next }
    $1 == "original" && $5 == "ok" { h = $4 + 0; e[h, $2 ~ /held/] = $9; o[h, $2 ~ /held/] = $13; b[h, $2 ~ /held/] = $16; cpu[h, $2 ~ /held/] = $21; if (!(h in seen)) { seen[h] = 1; order[++n] = h } }
    END { print "| step [s] | torque held: error [m] | order | work by rectangles: gap [J] | torque at stage times: error [m] | order | work as a state: gap [J] |"; print "|---|---|---|---|---|---|---|"
      for (i = 1; i <= n; i++) { h = order[i]; g = ""; for (k in gap) if (k / h > 0.999 && k / h < 1.001) g = sprintf ("%.2g", gap[k])
        printf "| %g | %.2g | %s | %s | %.2g | %s | %.2g |\n", h, e[h, 1], o[h, 1] == "nan" ? "" : sprintf ("%.2f", o[h, 1]), g, e[h, 0], o[h, 0] == "nan" ? "" : sprintf ("%.2f", o[h, 0]), b[h, 0] } }
  ' "$csvo" "$csv" | section original
  for m in rk4+projection:metric=identity:inputs=held rk4+projection; do
    awk -F, -v m="$m" '$1 == "original" && $2 == m && $5 == "ok" { print $4, $9, $21 }' "$csv" >"$work/$m"
  done
  awk -F, 'NR > 1 { g = $2 - $3; print $1, g < 0 ? -g : g }' "$csvo" >"$work/gap"
  awk -F, '$1 == "original" && $2 == "rk4+projection" && $5 == "ok" { print $4, $16 }' "$csv" >"$work/balance"
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
    BEGIN { print "| method | position | grows | velocity | grows | balance [J] | grows |"; print "|---|---|---|---|---|---|---|" }
    NR > 1 && $6 == "ok" && ($1 == "methods" || $2 ~ /alpha=(1|10|100):beta=(1|10|100)$/ || $2 ~ /metric=mass:every=(2|10|100)$/) {
      printf "| `%s` | %.1e | %s | %.1e | %s | %.1e | %s |\n", $2, $8, power($10), $11, power($13), $14, power($16) }' "$csvd" | section drift
fi

# ---- Long runs ----

# Energy of the contact oscillator over 10^5 periods; problem 1: reversible, 2: perturbed.
csvl=$results/long-$machine.csv
if [ -f "$csvl" ]; then
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
if [ -f "$text" ]; then { echo '```'; cat "$text"; echo '```'; } | section effects; fi

# ---- Against programs by hand of the same kind ----

csvp=$results/peers-$machine.csv
if [ -f "$csvp" ]; then
  awk -F'"' '
    function ratio(x) { return x > 0 ? sprintf ("%.2f", x) : "" }
    BEGIN { print "| method | by hand | error [m] | by hand [ms] | Pinwheel [ms] | ratio | evaluations by hand | Pinwheel | instructions of each by hand | Pinwheel | ratio of instructions | target [ms] |"
            print "|---|---|---|---|---|---|---|---|---|---|---|---|" }
    NR > 1 { split ($1, m, ","); split ($3, v, ",") # error, times, evaluations, instructions, target
      for (i = 3; i <= 6; i++) if (v[i] == 0) v[i] = ""
      printf "| `%s` | %s | %s | %s | %s | %s |", m[1], $2, v[2], v[3], v[4], ratio(v[3] ? v[4] / v[3] : 0)
      printf " %s | %s | %s | %s | %s | %s |\n", v[5], v[6], v[7], v[8], ratio(v[5] * v[7] > 0 ? v[6] * v[8] / (v[5] * v[7]) : 0), v[9] == 0 ? "" : v[9] }' "$csvp" | section peers
fi
