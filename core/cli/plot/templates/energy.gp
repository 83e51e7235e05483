# include look.gp

# ---- Energies and work; the error of the energy balance, with a power of ten of its own ----
# Above: t_end [s].

title = 'energy, work and their balance'
stats 'energy.dat' using 2 name 'kinetic' nooutput
stats 'energy.dat' using 3 name 'potential' nooutput
stats 'energy.dat' using 4 name 'work' nooutput
stats 'energy.dat' using 5 name 'loss' nooutput
stats 'energy.dat' using 7 name 'balance' nooutput
at_rest = kinetic_min == 0 && kinetic_max == 0 && potential_min == potential_max && work_min == work_max
balance_exponent = power(balance_min, balance_max)
energy_exponent = power(min(min(kinetic_min, potential_min), min(work_min, loss_min)), \
  max(max(kinetic_max, potential_max), max(work_max, loss_max)))
curve(column, look) = sprintf("'energy.dat' using 1:($%d/10.0**energy_exponent) with lines %s", column, look)
curves = 'plot '.curve(2, "lw 2.6 dt 1 lc rgb '#ddaa33' title 'kinetic'")
if (potential_min != 0 || potential_max != 0) {
  curves = curves.', '.curve(3, "lw 1.4 dt (10,6) lc rgb '#777777' title 'potential'")
}
if (loss_min != 0 || loss_max != 0) {
  curves = curves.', '.curve(5, "lw 1.2 dt (4,3) lc rgb '#cc6677' title 'dissipated'")
}
curves = curves.', '.curve(4, "lw 0.8 dt 1 lc rgb '#004488' title 'work'")
legend_top = top
top = top + 11
panel_height = narrow ? 84.0 : 112.0
height = top + 2*panel_height + 10 + bottom
set xrange [0:t_end]
do for [form in forms] {
  eval page(form)
  eval key(legend_top, 8)
  eval bare_x
  set ylabel axis('energy, work', 'J', energy_exponent)
  if (at_rest) { set yrange [-1:1] } else { set yrange [*:*] }
  eval panel(left, width - right, top, top + panel_height)
  eval curves
  set format x
  set xlabel 't [s]'
  set ylabel axis('balance', 'J', balance_exponent)
  if (balance_min == balance_max) { set yrange [-1:1] } else { set yrange [*:*] }
  eval panel(left, width - right, top + panel_height + 10, top + 2*panel_height + 10)
  plot 'energy.dat' using 1:($7/10.0**balance_exponent) with lines lt 1 lw 0.7 notitle
  eval finish
}
