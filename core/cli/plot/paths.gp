
# ---- Paths of wheels and markers, or of the centres of mass ----

do for [form in 'svg png'] {
  eval page(form)
  set xlabel 'x [m]'
  set ylabel 'y [m]'
  unset xzeroaxis
  do for [i = 1:panels] {
    eval legend(i == panels)
    eval place(i)
    eval draw(2, 3, i == 1)
  }
  unset multiplot
  unset output
}
