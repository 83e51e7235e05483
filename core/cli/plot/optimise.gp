
# ---- Output of every run against each unknown, the best one marked ----

title = 'runs of the optimisation'
columns = min(panels, 2)
rows = (panels + columns - 1)/columns
gap = 84.0
wide = columns == 1 ? 560.0 : 420.0
high = rows == 1 ? 380.0 : 280.0
left = 96.0
top = 66.0
width = left + columns*(wide + gap) - gap + right
height = top + rows*(high + gap) - gap + bottom
set style line 1 pt 7 ps 0.4 lc rgb '#004488'
set style line 2 pt 7 ps 0.4 lc rgb '#bbbbbb'
set style line 3 pt 6 ps 1.6 lw 2 lc rgb '#bb5566'
do for [form in 'svg png'] {
  eval page(form)
  eval key(36.0, 3)
  unset xlabel
  unset ylabel
  unset xzeroaxis
  set tics scale 0
  set format ''
  set border 0
  unset grid
  set xrange [0:1]
  set yrange [0:1]
  eval panel(left, width - right, 42.0, top - 2.0)
  plot for [i = 1:3] NaN with points ls i title word('feasible infeasible best', i)
  unset key
  set tics scale 0.6
  set format '%g'
  set border 31
  set grid back lt 1 lw 0.6 lc rgb '#dddddd'
  set xzeroaxis lt 1 lw 0.8 lc rgb '#999999'
  set autoscale
  do for [i = 1:panels] {
    place = (i - 1) % columns
    row = (i - 1)/columns
    x = left + place*(wide + gap)
    y = top + row*(high + gap)
    eval panel(x, x + wide, y, y + high)
    set xlabel label[i]
    set ylabel (place == 0 ? short(objective) : '')
    plot 'optimise.dat' using 1 + i:(column(3 + unknowns) == 0 ? column(2 + unknowns) : NaN) with points ls 2 notitle, \
      '' using 1 + i:(column(3 + unknowns) == 1 ? column(2 + unknowns) : NaN) with points ls 1 notitle, \
      '+' using (best[i]):(value) every 100000 with points ls 3 notitle
  }
  unset multiplot
  unset output
}
