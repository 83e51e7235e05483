# include look.gp

# ---- Derivatives of outputs along the run: a panel for each output, with a curve for each unknown ----
# Above: unknowns and panels (their numbers), t_end [s], output[k], label of each curve, panel by panel.

data = name.'.dat'
title = 'derivatives along the run'
eval lines(unknowns)
array lowest[panels]
array highest[panels]
do for [k = 1:panels] {
  stats data index (k - 1)*unknowns:k*unknowns - 1 using 2 name 'slope' nooutput
  lowest[k] = slope_min
  highest[k] = slope_max
  left = margin_of(slope_min, slope_max, 0)
}
panel_height = 112.0
gap = 34.0
legend_height = rows(unknowns, 1)
height = top + panels*(legend_height + panel_height + gap) - gap + bottom
set xrange [0:t_end]
do for [form in forms] {
  eval page(form)
  y = top
  do for [k = 1:panels] {
    eval key(y, 1)
    set xlabel (k == panels ? 't [s]' : '')
    set ylabel short(output[k]) noenhanced
    eval panel(left, width - right, y + legend_height, y + legend_height + panel_height)
    eval range('y', lowest[k], highest[k], 0)
    plot for [i = 1:unknowns] data index (k - 1)*unknowns + i - 1 using 1:2 with lines lt i \
      title label[(k - 1)*unknowns + i]
    y = y + legend_height + panel_height + gap
  }
  eval finish
}
