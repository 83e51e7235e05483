# include look.gp
# include methods.gp

# ---- Drift: residuals and energy defect, a panel each ----
# Above: quantities, a list of the numbers 1 to 3 of what is shown: columns 2 to 4 of the data.

data = name.'.dat'
logarithmic = name ne 'drift'
title = name eq 'drift' ? 'drift of the constraints and the energy' : name eq 'drift-baumgarte' ? \
  "largest drift by Baumgarte's parameters" : 'largest drift by the interval between projections'
label_of_x = name eq 'drift' ? 't [s]' : name eq 'drift-baumgarte' ? 'α [1/s]' : 'steps per projection (every)'
panel_height = narrow ? 90.0 : 112.0
height = top + words(quantities)*(panel_height + 10) - 10 + bottom
array label_of_y[3] = ['position residual', 'velocity residual', 'energy defect [J]']
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
# A curve has a mark at every step-th point, 10 to 19 in all, at other times than those of other methods.
stats data index 0 using 1 name 'first' nooutput
step = logarithmic ? 1 : max(1, int(first_records/10))
do for [form in forms] {
  eval page(form)
  eval key(legend_top, per_row)
  set format x ''
  set format y '10^{%T}'
  set xlabel ''
  y = top
  do for [n = 1:words(quantities)] {
    k = word(quantities, n) + 0
    if (n == words(quantities)) {
      set format x
      set xlabel label_of_x
    }
    set ylabel label_of_y[k]
    set yrange [least[k]:most[k]]
    eval panel(left, width - right, y, y + panel_height)
    plot for [i = 1:methods] data index i - 1 using 1:k + 1 with lines ls i notitle, \
         for [i = 1:methods] data index i - 1 every step::int(step*(i - 1.0)/methods) using 1:k + 1 \
           with points ls i notitle, \
         for [i = 1:methods] NaN with linespoints ls i title y == top ? label[i] : ''
    y = y + panel_height + 10
  }
  eval finish
}
