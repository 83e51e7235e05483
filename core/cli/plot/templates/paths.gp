# include look.gp
# include curves.gp
# include plane.gp

# ---- Paths of wheels and markers, or of the centres of mass ----

title = 'paths of the '.(what eq 'body' ? 'centres of mass' : words(markers) == 0 ? 'wheels' : \
  words(markers) < curves ? 'wheels and markers' : 'markers')
do for [form in forms] {
  eval page(form)
  eval axes
  do for [i = 1:panels] {
    eval legend(i == panels)
    eval place(i)
    eval draw(2, 3, 0, i == 1)
  }
  eval finish
}
