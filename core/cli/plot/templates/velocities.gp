# include look.gp
# include curves.gp

# ---- Velocities of the centres of mass ----

title = 'velocities of the centres of mass'
stats data using 5 name 'vx' nooutput
stats data using 6 name 'vy' nooutput
px = power(vx_min, vx_max)
py = power(vy_min, vy_max)
high = narrow ? 84.0 : 112.0
height = top + 2*high + 10 + bottom
set xrange [0:t_end]
do for [form in forms] {
  eval page(form)
  eval legend(1)
  set format x ''
  set xlabel ''
  set ylabel axis('v_x', 'm/s', px)
  eval panel(left, width - right, top, top + high)
  eval yrange(vx_min, vx_max, px)
  eval draw(1, 5, px, 1)
  unset colorbox
  set format x
  set xlabel 't [s]'
  set ylabel axis('v_y', 'm/s', py)
  eval panel(left, width - right, top + high + 10, top + 2*high + 10)
  eval yrange(vy_min, vy_max, py)
  eval draw(1, 6, py, 0)
  unset multiplot
  unset output
}
