# include look.gp
# include curves.gp

# ---- Velocities of the centres of mass ----

title = 'velocities of the centres of mass'
stats data using 5 name 'vx' nooutput
stats data using 6 name 'vy' nooutput
x_exponent = power(vx_min, vx_max)
y_exponent = power(vy_min, vy_max)
left = margin_of(vx_min, vx_max, x_exponent)
left = margin_of(vy_min, vy_max, y_exponent)
panel_height = narrow ? 84.0 : 112.0
height = top + 2*panel_height + 10 + bottom
set xrange [0:t_end]
do for [form in forms] {
  eval page(form)
  eval legend(1)
  eval bare_x
  set ylabel axis('v_x', 'm/s', x_exponent)
  eval panel(left, width - right, top, top + panel_height)
  eval range('y', vx_min, vx_max, x_exponent)
  eval draw(1, 5, x_exponent, 1)
  unset colorbox
  set format x
  set xlabel 't [s]'
  set ylabel axis('v_y', 'm/s', y_exponent)
  eval panel(left, width - right, top + panel_height + 10, top + 2*panel_height + 10)
  eval range('y', vy_min, vy_max, y_exponent)
  eval draw(1, 6, y_exponent, 0)
  eval finish
}
