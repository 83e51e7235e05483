# include look.gp
# include curves.gp

# ---- Angular velocities; where they oscillate often, the end of the run in detail as well ----

stats data using 7 name 'omega' nooutput
most_extrema = 0 # the largest number of extrema of a curve, without round-off
do for [i = 1:curves] {
  stats data index i - 1 using 7 name 'one' nooutput
  limit = 1e-6*max(abs(one_min), abs(one_max))
  extrema = 0
  sign = 0 # of the last change, as `now` is of the present one
  previous = NaN
  stats data index i - 1 using (change = $7 - previous, previous = $7, now = (change > limit) - (change < -limit), \
    extrema = extrema + (now*sign < 0), sign = now ? now : sign, extrema) name 'one' nooutput
  most_extrema = max(most_extrema, extrema)
}
# The part of the run shown in detail, 0 to 1: with at most 12 extrema, but not less than 2 %.
detail = most_extrema < 30 ? 0 : most_extrema <= 60 ? 0.2 : most_extrema <= 120 ? 0.1 : \
  most_extrema <= 240 ? 0.05 : 0.02
title = 'angular velocities'.(detail > 0 ? ', and their last part in detail' : '')
panel_height = detail > 0 ? 112.0 : narrow ? 130.0 : 170.0
omega_exponent = power(omega_min, omega_max)
left = margin_of(omega_min, omega_max, omega_exponent)
height = top + panel_height + (detail > 0 ? 30 + panel_height : 0) + bottom
do for [form in forms] {
  eval page(form)
  eval legend(1)
  set xlabel 't [s]'
  set ylabel axis('ω', 'rad/s', omega_exponent)
  set xrange [0:t_end]
  eval panel(left, width - right, top, top + panel_height)
  eval range('y', omega_min, omega_max, omega_exponent)
  eval draw(1, 7, omega_exponent, 1)
  if (detail > 0) {
    set xrange [t_end*(1 - detail):t_end]
    unset colorbox
    eval panel(left, width - right, top + panel_height + 30, top + 2*panel_height + 30)
    eval draw(1, 7, omega_exponent, 0)
  }
  eval finish
}
