# include look.gp

# ---- Output of every run against each unknown, the best one marked ----

title = 'runs of the optimisation'
across = narrow ? 1 : min(panels, 2)
down = (panels + across - 1)/across
gap = 40.0
wide = (width - left - right + gap)/across - gap
high = wide*(across == 1 ? 0.6 : 0.7)
above = top
top = top + 13
height = top + down*(high + gap) - gap + bottom
set style line 1 pt 7 ps 0.4 lc rgb '#004488'
set style line 2 pt 7 ps 0.4 lc rgb '#bbbbbb'
set style line 3 pt 6 ps 1.6 lw 1.2 lc rgb '#cc6677'
do for [form in forms] {
  eval page(form)
  eval key(above, 3)
  set xlabel ''
  set ylabel ''
  unset xzeroaxis
  set tics scale 0
  set format ''
  set border 0
  unset grid
  set xrange [0:1]
  set yrange [0:1]
  eval panel(left, width - right, above - 1, top - 1)
  plot for [i = 1:3] NaN with points ls i title word('feasible infeasible best', i)
  unset key
  set tics scale 0.5
  set format '%g'
  set border 31
  set grid back lt 1 lw 0.4 lc rgb '#dddddd'
  set xzeroaxis lt 1 lw 0.5 lc rgb '#999999'
  set autoscale
  do for [i = 1:panels] {
    place = (i - 1) % across
    row = (i - 1)/across
    x = left + place*(wide + gap)
    y = top + row*(high + gap)
    eval panel(x, x + wide, y, y + high)
    set xlabel label[i] noenhanced
    set ylabel (place == 0 ? short(objective) : '') noenhanced
    plot 'optimise.dat' using 1 + i:(column(3 + unknowns) == 0 ? column(2 + unknowns) : NaN) with points ls 2 notitle, \
      '' using 1 + i:(column(3 + unknowns) == 1 ? column(2 + unknowns) : NaN) with points ls 1 notitle, \
      '+' using (best[i]):(value) every 100000 with points ls 3 notitle
  }
  unset multiplot
  unset output
}
