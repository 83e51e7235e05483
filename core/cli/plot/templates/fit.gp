# include look.gp

# ---- Data and model of each column, below them the residuals ----

title = 'data and fitted model'
across = narrow ? 1 : min(panels, 2)
down = (panels + across - 1)/across
left = 58.0 # for the digits of residuals
gap = 64.0
wide = (width - left - right + gap)/across - gap
high = wide*(across == 1 ? 0.5 : 0.6)
low = max(0.6*high, 66.0)
block = high + 8 + low + 40
above = top
top = top + 13
height = top + down*block - 40 + bottom
set style line 1 pt 7 ps 0.35 lw 0.6 lc rgb '#888888'
set style line 2 lw 1.1 lc rgb '#004488'
bars(i, y) = sprintf('plot "fit.dat" index %d using 1:(%s)%s ls 1 notitle', i - 1, y, \
  weighted ? ':3 with yerrorbars' : ' with points')
do for [form in forms] {
  eval page(form)
  eval key(above, 2)
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
  plot NaN with points ls 1 title (weighted ? 'data ± σ' : 'data'), NaN with lines ls 2 title 'model'
  unset key
  set tics scale 0.5
  set border 31
  set grid back lt 1 lw 0.4 lc rgb '#dddddd'
  set xzeroaxis lt 1 lw 0.5 lc rgb '#999999'
  set autoscale
  do for [i = 1:panels] {
    x = left + ((i - 1) % across)*(wide + gap)
    y = top + ((i - 1)/across)*block
    eval panel(x, x + wide, y, y + high)
    set format x ''
    set format y '%g'
    set xlabel ''
    set ylabel label[i] noenhanced
    eval bars(i, 'column(2)').', "" index '.(i - 1).' using 1:4 with lines ls 2 notitle'
    eval panel(x, x + wide, y + high + 8, y + high + 8 + low)
    set format x '%g'
    set xlabel 't [s]'
    set ylabel 'residual'
    eval bars(i, 'column(4) - column(2)')
  }
  unset multiplot
  unset output
}
