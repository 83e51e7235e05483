
# ---- Data and model of each column, below them the residuals ----

title = 'data and fitted model'
gap = 100.0
wide = panels == 1 ? 640.0 : 440.0
columns = min(panels, 2)
rows = (panels + columns - 1)/columns
high = 240.0
low = 160.0
block = high + 14 + low + 74
top = 66.0
width = left + columns*(wide + gap) - gap + right
height = top + rows*block - 74 + bottom
set style line 1 pt 7 ps 0.5 lw 1 lc rgb '#888888'
set style line 2 lw 1.8 lc rgb '#004488'
bars(i, y) = sprintf('plot "fit.dat" index %d using 1:(%s)%s ls 1 notitle', i - 1, y, \
  weighted ? ':3 with yerrorbars' : ' with points')
do for [form in 'svg png'] {
  eval page(form)
  eval key(36.0, 2)
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
  plot NaN with points ls 1 title (weighted ? 'data, one standard deviation' : 'data'), NaN with lines ls 2 title 'model'
  unset key
  set tics scale 0.6
  set border 31
  set grid back lt 1 lw 0.6 lc rgb '#dddddd'
  set xzeroaxis lt 1 lw 0.8 lc rgb '#999999'
  set autoscale
  do for [i = 1:panels] {
    x = left + ((i - 1) % columns)*(wide + gap)
    y = top + ((i - 1)/columns)*block
    eval panel(x, x + wide, y, y + high)
    set format x ''
    set format y '%g'
    unset xlabel
    set ylabel label[i]
    eval bars(i, 'column(2)').', "" index '.(i - 1).' using 1:4 with lines ls 2 notitle'
    eval panel(x, x + wide, y + high + 14, y + high + 14 + low)
    set format x '%g'
    set xlabel 't [s]'
    set ylabel 'residual'
    eval bars(i, 'column(4) - column(2)')
  }
  unset multiplot
  unset output
}
