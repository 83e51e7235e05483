
# ---- Velocities of the centres of mass ----

title = 'velocities of the centres of mass'
stats data using 5 name 'vx' nooutput
stats data using 6 name 'vy' nooutput
height = top + 2*235 + 16 + bottom
set xrange [0:t_end]
do for [form in 'svg png'] {
  eval page(form)
  eval legend(1)
  set format x ''
  unset xlabel
  set ylabel 'vx [m/s]'
  eval panel(left, width - right, top, top + 235.0)
  eval yrange(vx_min, vx_max)
  eval draw(1, 5, 1)
  unset colorbox
  set format x
  set xlabel 't [s]'
  set ylabel 'vy [m/s]'
  eval panel(left, width - right, top + 251.0, top + 486.0)
  eval yrange(vy_min, vy_max)
  eval draw(1, 6, 0)
  unset multiplot
  unset output
}
