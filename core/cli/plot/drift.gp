
# ---- Drift: residuals and energy balance, a panel each ----

data = name.'.dat'
logarithmic = name ne 'drift'
title = name eq 'drift' ? 'drift of the constraints and the energy' : name eq 'drift-baumgarte' ? \
  "largest drift by Baumgarte's parameters" : 'largest drift by the interval between projections'
label_of_x = name eq 'drift' ? 't [s]' : name eq 'drift-baumgarte' ? 'alpha [1/s]' : 'steps per projection (every)'
left = 104.0
columns = max(1, int((width - left - right + 8)/(80 + 8.0*max(longest, 15))))
top = 46 + 22*((methods + columns - 1)/columns)
height = top + words(quantities)*236 - 16 + bottom
array label_of_y[3] = ['position residual', 'velocity residual', 'energy balance [J]']
array least[3]
array most[3]
stats data using 1 name 'x' nooutput
do for [n = 1:words(quantities)] {
  k = word(quantities, n) + 0
  stats data using k + 1 name 'y' nooutput
  least[k] = 10**floor(log10(y_min) - 0.2)
  most[k] = 10**ceil(log10(y_max) + 0.2)
}
if (logarithmic) {
  set logscale xy
  set xrange [x_min/1.15:x_max*1.15]
} else {
  set logscale y
  set xrange [0:x_max]
}
unset offsets
unset xzeroaxis
do for [form in 'svg png'] {
  eval page(form)
  eval key(36.0, columns).' samplen 5'
  set format x ''
  set format y '1e%T'
  unset xlabel
  y = top
  do for [n = 1:words(quantities)] {
    k = word(quantities, n) + 0
    if (n == words(quantities)) {
      set format x
      set xlabel label_of_x
    }
    set ylabel label_of_y[k]
    set yrange [least[k]:most[k]]
    eval panel(left, width - right, y, y + 220)
    plot for [i = 1:methods] data index i - 1 using 1:k + 1 with linespoints ls i title y == top ? label[i] : ''
    y = y + 236
  }
  unset multiplot
  unset output
}
