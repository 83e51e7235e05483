# Part of report.sh: the table and the figure from the results of the program engine.

# The lines of the CSV with tabs between their fields; the first field may be quoted.
split () {
  awk 'NR > 1 { name = $0; rest = $0
    if (/^"/) { name = substr ($0, 2); rest = name; sub (/".*/, "", name); sub (/^[^"]*",/, "", rest) }
    else { sub (/,.*/, "", name); sub (/^[^,]*,/, "", rest) }
    gsub (/,/, "\t", rest); print name "\t" rest }' "$results/engine-$machine.csv"
}

engine_tables () {
  split | awk -F '\t' '
    function short(x) { return x == "" ? "" : sprintf(x >= 1000 ? "%.0f" : "%.4g", x) }
    BEGIN { OFS = FS; print "| what | by hand or general [ns] | Pinwheel [ns] | ratio | of instructions |"
            print "|---|---|---|---|---|" }
    /massless/ || /no target/ || /ida/ || /ns per body/ { next }
    $1 ~ /evaluation, specialised .right. against general/ { scene = $1; sub(/,.*/, "", scene); next }
    $1 == "one step of rk4+projection" { $1 = scene ": specialised against general" }
    { sub(/, a step of rk4.projection, runs in lanes .right. against general$/, ": in lanes against general", $1)
      sub(/one step of rk4.projection$/, "a step", $1); sub(/one evaluation$/, "an evaluation", $1) }
    $1 ~ /^(snakeboard|n-trailer|roller-racer|andrews-squeezer|wheeled-snake):/ { next } # the CSV has all scenes
    $2 ~ /^(evaluation|step|body)$/ {
      sub(/, one evaluation, per body$/, "", $1)
      printf "| %s | %s | %s | %s | %s |\n", $1 ($2 == "body" ? ", per body" : ""), short($3), short($4), short($5), ($6 > 0 && $7 > 0 ? sprintf("%.2f", $7 / $6) : "") }'
  echo
  echo '| growth with the number of bodies N | measured |'
  echo '|---|---|'
  split | awk -F '\t' '$2 == "slope" { printf "| %s | %s |\n", $1, ($5 != "" ? $5 : $4) }'
}

engine_figure () {
  for what in 'chain, evaluation' 'chain, projection' 'chain, step of ida+ggl' 'snake, evaluation' 'grid, evaluation'; do
    split | awk -F '\t' -v what="$what, " 'index($1, what) == 1 && / bodies: ns per body/ {
      n = substr($1, length(what) + 1); sub(/ .*/, "", n); print n, $4 }' >"$work/$what"
  done
  draw engine-growth 620 'Cost per body against the size of the scene' <<G
set logscale xy
set format '10^{%T}'
set xlabel 'bodies N'
set ylabel 'time per body [ns]'
set key inside top left
eval panel(left, width - right, 22, height - bottom)
set xrange [7:150000]
plot '$work/chain, evaluation' w lp lw 1.1 pt 7 lc rgb '#004488' t 'chain: one evaluation', \
     '$work/chain, projection' w lp lw 1.1 pt 5 dt 2 lc rgb '#cc6677' t 'chain: one projection', \
     '$work/chain, step of ida+ggl' w lp lw 1.1 pt 9 dt 4 lc rgb '#c49a00' t 'chain: one step of ida+ggl', \
     '$work/snake, evaluation' w lp lw 0.7 pt 6 dt 3 lc rgb '#117755' t 'wheeled snake: one evaluation', \
     '$work/grid, evaluation' w lp lw 0.7 pt 4 dt 5 lc rgb '#666666' t 'grid of pinned bars: one evaluation'
G
}

if [ -f "$results/engine-$machine.csv" ]; then
  engine_tables | section engine
  engine_figure
fi
