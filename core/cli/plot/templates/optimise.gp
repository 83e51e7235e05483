# include look.gp

# ---- Output of every run against each unknown, the best one marked ----
# Above: unknowns (their number), panels (number of unknowns shown), label[i], best[i] (value of an unknown in the best
# run), objective (label of the output), value (of the output in the best run).  Columns of optimise.dat: number of the
# run, the unknowns, the output, 1 if the constraints are satisfied.

title = 'runs of the optimisation'
stats 'optimise.dat' using 2 + unknowns name 'output' nooutput
left = margin_of(output_min, output_max, 0)
gap = left - 4
array lowest[panels]
array highest[panels]
do for [i = 1:panels] {
  stats 'optimise.dat' using 1 + i name 'unknown' nooutput
  lowest[i] = unknown_min
  highest[i] = unknown_max
}
eval two_columns
panel_height = panel_width*(panel_columns == 1 ? 0.6 : 0.7)
legend_top = top
top = top + 13
height = top + panel_rows*(panel_height + gap) - gap + bottom
set style line 1 pt 7 ps 0.4 lc rgb '#004488'
set style line 2 pt 7 ps 0.4 lc rgb '#bbbbbb'
set style line 3 pt 6 ps 1.6 lw 1.2 lc rgb '#cc6677'
do for [form in forms] {
  eval page(form)
  eval begin_legend(3)
  plot for [i = 1:3] NaN with points ls i title word('feasible infeasible best', i)
  eval end_legend
  set format '%g'
  set xzeroaxis lt 1 lw 0.5 lc rgb '#999999'
  do for [i = 1:panels] {
    x = left + ((i - 1) % panel_columns)*(panel_width + gap)
    y = top + ((i - 1)/panel_columns)*(panel_height + gap)
    eval panel(x, x + panel_width, y, y + panel_height)
    set xlabel label[i] noenhanced
    set ylabel (x == left ? objective : '') noenhanced
    eval range('x', lowest[i], highest[i], 0)
    eval range('y', output_min, output_max, 0)
    plot 'optimise.dat' using 1 + i:(column(3 + unknowns) == 0 ? column(2 + unknowns) : NaN) with points ls 2 notitle, \
      '' using 1 + i:(column(3 + unknowns) == 1 ? column(2 + unknowns) : NaN) with points ls 1 notitle, \
      '+' using (best[i]):(value) every 100000 with points ls 3 notitle
  }
  eval finish
}
