
# ---- Output of every run against each unknown, the best one marked ----

title = 'runs of the optimisation'
columns = panels < 3 ? panels : panels == 4 ? 2 : 3
rows = (panels + columns - 1)/columns
gap = 84.0
wide = columns == 1 ? 560.0 : columns == 2 ? 400.0 : 300.0
high = rows == 1 ? 380.0 : 280.0
left = 96.0
top = 66.0
width = left + columns*(wide + gap) - gap + right
height = top + rows*(high + gap) - gap + bottom
do for [form in 'svg png'] {
  eval page(form)
  eval key(36.0, 3)
  do for [i = 1:panels] {
    column = (i - 1) % columns
    row = (i - 1)/columns
    x = left + column*(wide + gap)
    y = top + row*(high + gap)
    eval panel(x, x + wide, y, y + high)
    set xlabel label[i]
    set ylabel (column == 0 ? short(objective) : '')
    data = 'optimise.dat'
    output(sign) = 'using '.(1 + i).':($'.(3 + unknowns).' == '.sign.' ? $'.(2 + unknowns).' : NaN) with points '
    eval "plot data ".output(1)."pt 7 ps 0.4 lc rgb '#004488' title (i == 1 ? 'a run' : ''), ". \
      (constraints > 0 ? "data ".output(0)."pt 7 ps 0.4 lc rgb '#bbbbbb' title (i == 1 ? 'infeasible' : ''), " : ''). \
      "'+' using (best[i]):(value) every 100000 with points pt 6 ps 1.6 lw 2 lc rgb '#bb5566' title (i == 1 ? 'best' : '')"
  }
  unset multiplot
  unset output
}
