# include look.gp
# include curves.gp

# ---- Angular velocities; where they oscillate often, the end of the run in detail as well ----

stats data using 7 name 'omega' nooutput
turns = 0 # the largest number of extrema of a curve; round-off does not count
do for [i = 1:curves] {
  stats data index i - 1 using 7 name 'one' nooutput
  limit = 1e-6*max(abs(one_min), abs(one_max))
  extrema = 0
  before = 0
  old = NaN
  stats data index i - 1 using (change = $7 - old, old = $7, now = (change > limit) - (change < -limit), \
    extrema = extrema + (now*before < 0), before = now ? now : before, extrema) name 'one' nooutput
  turns = max(turns, extrema)
}
detail = turns < 30 ? 0 : turns*0.2 <= 12 ? 0.2 : turns*0.1 <= 12 ? 0.1 : turns*0.05 <= 12 ? 0.05 : 0.02
title = 'angular velocities'.(detail > 0 ? ', and their last part in detail' : '')
high = detail > 0 ? 112.0 : narrow ? 130.0 : 170.0
p = power(omega_min, omega_max)
height = top + high + (detail > 0 ? 30 + high : 0) + bottom
do for [form in forms] {
  eval page(form)
  eval legend(1)
  set xlabel 't [s]'
  set ylabel axis('ω', 'rad/s', p)
  set xrange [0:t_end]
  eval panel(left, width - right, top, top + high)
  eval yrange(omega_min, omega_max, p)
  eval draw(1, 7, p, 1)
  if (detail > 0) {
    set xrange [t_end*(1 - detail):t_end]
    unset colorbox
    eval panel(left, width - right, top + high + 30, top + 2*high + 30)
    eval draw(1, 7, p, 0)
  }
  unset multiplot
  unset output
}
