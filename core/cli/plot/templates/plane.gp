
# ---- Panels with equal axes: the whole run and, if the mechanism goes far, a close-up of its beginning ----
# Above: t_end (of the samples), t_closeup (end of the close-up in panel 2; 0: no panel 2) [s].
# Panel i shows x0[i] to x1[i] and y0[i] to y1[i] [m], at px0[i] to px1[i] and py0[i] to py1[i] of the page [pt].

if (name eq 'mechanism' && by_time) { bottom = bottom + 40 } # room for a colour bar
if (name eq 'mechanism') {
  legend_top = top
  label_length = 0
  items = by_time ? 0 : bodies
  do for [i = 1:items] { label_length = max(label_length, strlen(short(body[i]))) }
}
panels = t_closeup > 0 ? 2 : 1
array px0[2]
array px1[2]
array py0[2]
array py1[2]
array x0[2] = [1e300, 1e300]
array x1[2] = [-1e300, -1e300]
array y0[2] = [1e300, 1e300]
array y1[2] = [-1e300, -1e300]
# Extend the range of panel i by columns of a file: along one axis, z = 'x' or 'y', by column k; along both.
extend_axis(i, z, file, k) = sprintf('stats %s using %s nooutput; ', file, k). \
  sprintf('%s0[%d] = min(%s0[%d], STATS_min); %s1[%d] = max(%s1[%d], STATS_max); ', z, i, z, i, z, i, z, i)
extend(i, file, x, y) = extend_axis(i, 'x', file, x).extend_axis(i, 'y', file, y)
# Column k, for panel 2 at times up to t_closeup.
during(i, k) = i == 1 ? sprintf('%d', k) : sprintf('($1 <= 1.000001*t_closeup ? $%d : NaN)', k)
do for [i = 1:panels] {
  if (name eq 'mechanism') {
    eval extend(i, i == 1 ? "'mechanism.dat'" : "'mechanism-closeup.dat'", '1', '2')
    if (ground) { eval extend(i, "'ground.dat'", '1', '2') }
    do for [k in markers] { eval extend(i, sprintf("'wheels.dat' index %s", k), during(i, 2), during(i, 3)) }
  } else { eval extend(i, 'data', during(i, 2), during(i, 3)) }
}
do for [i = 1:panels] {
  edge = 0.05*max(x1[i] - x0[i], y1[i] - y0[i])
  # not below the resolution of the data, 10 digits
  if (edge <= 1e-9*max(max(abs(x0[i]), abs(x1[i])), max(abs(y0[i]), abs(y1[i])))) {
    edge = max(1, 1e-6*max(max(abs(x0[i]), abs(x1[i])), max(abs(y0[i]), abs(y1[i]))))
  }
  x0[i] = x0[i] - edge
  x1[i] = x1[i] + edge
  y0[i] = y0[i] - edge
  y1[i] = y1[i] + edge
}
# Far from the origin, and for very long or short motions, the tics of an axis count from a round number, in units of a
# power of ten; otherwise gnuplot chooses them.
origin(lo, hi) = max(abs(lo), abs(hi)) < 2e3*(hi - lo) ? 0 : \
  (unit = 10.0**(floor(log10(hi - lo)) + 1), unit*floor(0.5*(lo + hi)/unit + 0.5))
do for [i = 1:panels] {
  from = origin(y0[i], y1[i])
  left = margin_of(y0[i] - from, y1[i] - from, power(y0[i] - from, y1[i] - from))
}
aspect(i, least, most) = min(max((y1[i] - y0[i])/(x1[i] - x0[i]), least), most)
most_height = narrow ? 300.0 : 380.0 # highest panel
full_width = width - left - right
px0[1] = left
if (panels == 1) {
  panel_width = full_width
  high = panel_width*aspect(1, 0.25, 2)
  if (high > most_height) {
    panel_width = max(0.6*full_width, panel_width*most_height/high)
    high = most_height
  }
  py0[1] = top
  py1[1] = top + high
  px0[1] = left + 0.5*(full_width - panel_width)
  px1[1] = px0[1] + panel_width
} else { if (narrow || aspect(1, 0, 1) < 0.5) { # a long straight path above its beginning
  py0[1] = top + 13
  py1[1] = py0[1] + full_width*aspect(1, 0.15, 0.8)
  px1[1] = left + full_width
  py0[2] = py1[1] + bottom + 16
  py1[2] = py0[2] + full_width*aspect(2, 0.25, 0.8)
  px0[2] = left
  px1[2] = left + full_width
} else { # side by side
  panel_width = full_width - (left - 4)
  px1[1] = left + 0.4*panel_width
  px0[2] = px1[1] + left - 4
  px1[2] = left + full_width
  py0[1] = top + 13
  py0[2] = py0[1]
  py1[1] = py0[1] + max(0.4*panel_width*aspect(1, 0.5, 1.6), 0.6*panel_width*aspect(2, 0.5, 1.1))
  py1[2] = py1[1]
}}
# The legend is as wide as the first panel; panels move down for its rows.
per_row = max(1, int((px1[1] - px0[1])/(32 + letter*label_length)))
shift = items ? rows(items, per_row) - (top - legend_top) : 0
do for [i = 1:panels] {
  py0[i] = py0[i] + shift
  py1[i] = py1[i] + shift
}
height = py1[panels] + bottom
# Extends ranges to the aspect ratio of the panels.
do for [i = 1:panels] {
  ratio = (py1[i] - py0[i])/(px1[i] - px0[i])
  high = max(y1[i] - y0[i], (x1[i] - x0[i])*ratio)
  x = 0.5*(x0[i] + x1[i])
  y = 0.5*(y0[i] + y1[i])
  x0[i] = x - 0.5*high/ratio
  x1[i] = x + 0.5*high/ratio
  y0[i] = y - 0.5*high
  y1[i] = y + 0.5*high
}
# Tics and label of axis k: x of panel 1, y of panel 1, ...
array tics[2*panels]
array label_of[2*panels]
do for [k = 1:2*panels] {
  i = (k + 1)/2
  lo = k % 2 ? x0[i] : y0[i]
  hi = k % 2 ? x1[i] : y1[i]
  from = origin(lo, hi)
  n = power(lo - from, hi - from)
  label_of[k] = axis((k % 2 ? 'x' : 'y').(from != 0 ? sprintf(from < 0 ? ' + %.12g' : ' − %.12g', abs(from)) : ''), 'm', n)
  tics[k] = ''
  unit = 10.0**floor(log10((hi - lo)/6))
  step = unit*((hi - lo)/unit < 9 ? 1 : (hi - lo)/unit < 21 ? 2 : (hi - lo)/unit < 45 ? 5 : 10)
  do for [j = int(ceil((lo - from)/step)):(n || from != 0 ? int(floor((hi - from)/step)) : -2147483647)] {
    tics[k] = tics[k].sprintf(", '%s%g' %.15g", j < 0 ? '−' : '', abs(j*step/10.0**n), from + j*step)
  }
  tics[k] = strlen(tics[k]) ? '('.tics[k][3:*].')' : 'autofreq'
}
axes = 'unset xzeroaxis'
# The paths of the model (model_paths: their number), below the rest of a panel.
below = model_paths ? "'model-paths.dat' using 1:2 with lines lw 0.7 dt 1 lc rgb '#999999' notitle, " : ''
place(i) = panel(px0[i], px1[i], py0[i], py1[i]). \
  sprintf("; set xlabel '%s'; set ylabel '%s'; ", label_of[2*i - 1], label_of[2*i]). \
  sprintf('set xtics %s; set ytics %s; ', tics[2*i - 1], tics[2*i]). \
  sprintf('set xrange [%.15g:%.15g]; set yrange [%.15g:%.15g]', x0[i], x1[i], y0[i], y1[i]). \
  (panels == 1 ? '' : i == 1 ? "; set title 'whole run'" : sprintf("; set title 'the first %.3g s'", t_closeup))
