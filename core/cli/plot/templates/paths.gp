# include look.gp
# include curves.gp
# include plane.gp

# ---- Paths of wheels and markers, or of the centres of mass ----

title = 'paths of the '.(what eq 'body' ? 'centres of mass' : words(markers) == 0 ? 'wheels' : \
  words(markers) < curves ? 'wheels and markers' : 'markers')
# A path that is no longer than a point is drawn as one.
points = ''
do for [i = 1:curves] {
  stats data index i - 1 using 2 name 'x' nooutput
  stats data index i - 1 using 3 name 'y' nooutput
  if (max(x_max - x_min, y_max - y_min) < 5e-3*(x1[1] - x0[1])) {
    points = points.sprintf(', data index %d every ::::0 using 2:3 with points lc rgb "%s" pt 7 ps 0.8 notitle', i - 1, \
                            numbered ? '#777777' : colour(i))
  }
}
do for [form in forms] {
  eval page(form)
  eval axes
  do for [i = 1:panels] {
    eval legend(i == panels)
    eval place(i)
    eval 'plot '.below.draw(2, 3, 0, i == 1)[6:*].points
  }
  eval finish
}
