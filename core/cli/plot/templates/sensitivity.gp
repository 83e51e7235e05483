
# ---- Derivatives of outputs along the run: a panel for each output ----

data = name.'.dat'
title = 'derivatives along the run'
height = top + panels*(268 + 22*unknowns) + bottom - 24
set xrange [0:t_end]
do for [form in 'svg png'] {
  eval page(form)
  y = top
  do for [k = 1:panels] {
    y = y + 22*unknowns
    eval key(y - 22*unknowns + 4, 1).' samplen 3.5'
    set xlabel (k == panels ? 't [s]' : '')
    set ylabel short(output[k])
    eval panel(left, width - right, y, y + 220)
    plot for [i = 1:unknowns] data index (k - 1)*unknowns + i - 1 using 1:2 with lines lt i \
      title label[(k - 1)*unknowns + i]
    y = y + 268
  }
  unset multiplot
  unset output
}
