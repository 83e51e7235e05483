# include look.gp

# ---- A periodic motion, paths and phase curves over a period; or a branch over the parameter; with multipliers ----
# Above: branch (0: a single motion), bodies (number of those shown), body[i], largest (modulus of a multiplier); for a
# branch label_of_x, first and last (range of the parameter), low[k] and high[k] (range of column 1 + k of the data).
# Blocks of the data: of a motion, the motion (t / T, then x, y, phi, omega of each body), its multipliers, the trivial
# ones; of a branch, its stable parts, its unstable parts, events, multipliers, the trivial ones.

data = name.'.dat'
title = branch ? 'periodic motions' : 'periodic motion over one period, Floquet multipliers'
label_length = 12
items = branch ? 4 : bodies
do for [i = 1:(branch ? 0 : bodies)] { label_length = max(label_length, strlen(short(body[i]))) }
eval lines(max(4, bodies))
per_row = columns(label_length)
legend_top = top
top = top + rows(items, per_row)
full_width = width - left - right
square_side = narrow ? full_width : (full_width - 46)/2 # of the panel of multipliers
reach = 1.12*max(1, largest) # half of its range
square(x, y) = sprintf('set xrange [%g:%g]; set yrange [%g:%g]; ', -reach, reach, -reach, reach). \
  panel(x, x + square_side, y, y + square_side)
unset offsets
if (branch) {
  panel_height = narrow ? 84.0 : 104.0
  panels = 0
  do for [k = 1:3] { panels = panels + (high[k] - low[k] > 1e-9*abs(high[k])) }
  first_height = panels*(panel_height + 10) - 10
} else {
  array lowest[4] = [1e300, 1e300, 1e300, 1e300] # of x, y, phi, omega
  array highest[4] = [-1e300, -1e300, -1e300, -1e300]
  do for [i = 1:bodies] { do for [k = 1:4] {
    stats data index 0 using (column(4*i - 3 + k)) name 'a' nooutput
    lowest[k] = min(lowest[k], a_min)
    highest[k] = max(highest[k], a_max)
  }}
  x_min = lowest[1]
  x_max = highest[1]
  y_min = lowest[2]
  y_max = highest[2]
  edge = 0.05*max(x_max - x_min, y_max - y_min)
  if (edge < 1e-9) { edge = 0.1 }
  first_height = full_width*min(max((y_max - y_min + 2*edge)/(x_max - x_min + 2*edge), 0.2), 0.6)
  x_extent = max(x_max - x_min + 2*edge, (y_max - y_min + 2*edge)*full_width/first_height)
}
square_top = top + first_height + bottom + 16
height = square_top + square_side*(narrow && !branch ? 2 : 1) + bottom + (narrow && !branch ? bottom + 16 : 0)
do for [form in forms] {
  eval page(form)
  eval key(legend_top, per_row)
  if (branch) {
    set xrange [first:last]
    y = top
    do for [k = 1:3] { if (high[k] - low[k] > 1e-9*abs(high[k])) {
      set yrange [low[k] - 0.05*(high[k] - low[k]):high[k] + 0.05*(high[k] - low[k])]
      set format x (y + panel_height < top + first_height - 1 ? '' : '%g')
      set xlabel (y + panel_height < top + first_height - 1 ? '' : label_of_x) noenhanced
      set ylabel k == 1 ? 'displacement [m]' : k == 2 ? 'largest modulus' : 'period [s]'
      eval panel(left, width - right, y, y + panel_height)
      plot data index 0 using 1:1 + k with lines lw 1.1 dt 1 lc rgb '#004488' title (y == top ? 'stable' : ''), \
        data index 1 using 1:1 + k with lines lw 1.1 dt (8,5) lc rgb '#cc6677' title (y == top ? 'unstable' : '')
      y = y + panel_height + 10
    }}
  } else {
    set xrange [0.5*(x_min + x_max - x_extent):0.5*(x_min + x_max + x_extent)]
    y_extent = x_extent*first_height/full_width
    set yrange [0.5*(y_min + y_max - y_extent):0.5*(y_min + y_max + y_extent)]
    set xlabel 'x [m]'
    set ylabel 'y [m]'
    eval panel(left, width - right, top, top + first_height)
    # A point marks the beginning of the period, which has 400 intervals.
    plot for [i = 1:bodies] data index 0 using (column(4*i - 2)):(column(4*i - 1)) with lines lt i \
        title short(body[i]), \
      for [i = 1:bodies] '' index 0 using (column(4*i - 2)):(column(4*i - 1)) every 400 with points pt 7 ps 0.5 \
        lc rgb colour(i) notitle
    unset key
    eval range('x', lowest[3], highest[3], 0)
    eval range('y', lowest[4], highest[4], 0)
    set offsets graph 0.05,graph 0.05,graph 0.05,graph 0.05
    set xlabel 'φ [rad]'
    set ylabel 'ω [rad/s]'
    eval panel(left, left + square_side, square_top, square_top + square_side)
    plot for [i = 1:bodies] data index 0 using (column(4*i)):(column(4*i + 1)) with lines lt i notitle
    unset offsets
  }
  unset key
  set format x '%g'
  set xlabel 'real part'
  set ylabel 'imaginary part'
  set parametric
  set trange [0:2*pi]
  set cbrange [first:last]
  set cblabel label_of_x offset 1.5,0 noenhanced
  eval square(narrow ? left : branch ? left + 0.5*(full_width - square_side) : width - right - square_side, \
              narrow && !branch ? square_top + square_side + bottom + 16 : square_top)
  if (branch) {
    plot cos(t), sin(t) with lines lw 0.8 lc rgb '#777777' notitle, \
      data index 4 using 1:2 with points pt 6 ps 0.9 lw 0.8 lc rgb '#777777' notitle, \
      data index 3 using 1:2:3 with points pt 7 ps 0.4 lc palette notitle
  } else {
    plot cos(t), sin(t) with lines lw 0.8 lc rgb '#777777' notitle, \
      data index 2 using 1:2 with points pt 6 ps 0.9 lw 0.8 lc rgb '#777777' notitle, \
      data index 1 using 1:2 with points pt 7 ps 0.6 lc rgb '#cc6677' notitle
  }
  unset parametric
  eval finish
}
