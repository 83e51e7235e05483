# include look.gp

# ---- Derivatives of outputs along the run: a panel for each output ----

data = name.'.dat'
title = 'derivatives along the run'
eval lines(unknowns)
high = 112.0
gap = 34.0
above = rows(unknowns, 1)
height = top + panels*(above + high + gap) - gap + bottom
set xrange [0:t_end]
do for [form in forms] {
  eval page(form)
  y = top
  do for [k = 1:panels] {
    eval key(y, 1)
    set xlabel (k == panels ? 't [s]' : '')
    set ylabel short(output[k]) noenhanced
    eval panel(left, width - right, y + above, y + above + high)
    plot for [i = 1:unknowns] data index (k - 1)*unknowns + i - 1 using 1:2 with lines lt i \
      title label[(k - 1)*unknowns + i]
    y = y + above + high + gap
  }
  unset multiplot
  unset output
}
