# include look.gp

# ---- Energies and work; the error of the energy balance, with a power of ten of its own ----
# Above: t_end [s].

title = 'energy, work and their balance'
stats 'energy.dat' using 2 name 'kinetic' nooutput
stats 'energy.dat' using 3 name 'potential' nooutput
stats 'energy.dat' using 4 name 'work' nooutput
stats 'energy.dat' using 5 name 'loss' nooutput
stats 'energy.dat' using 7 name 'balance' nooutput
balance_exponent = power(balance_min, balance_max)
energy_min = min(min(kinetic_min, potential_min), min(work_min, loss_min))
energy_max = max(max(kinetic_max, potential_max), max(work_max, loss_max))
energy_exponent = power(energy_min, energy_max)
left = margin_of(energy_min, energy_max, energy_exponent)
left = margin_of(balance_min, balance_max, balance_exponent)
curve(column, look) = sprintf("'energy.dat' using 1:($%d/10.0**energy_exponent) with lines %s", column, look)
items = 2
curves = 'plot '.curve(2, "lw 2.6 dt 1 lc rgb '#ddaa33' title 'kinetic'")
if (potential_min != 0 || potential_max != 0) {
  items = items + 1
  curves = curves.', '.curve(3, "lw 1.4 dt (10,6) lc rgb '#777777' title 'potential'")
}
if (loss_min != 0 || loss_max != 0) {
  items = items + 1
  curves = curves.', '.curve(5, "lw 1.2 dt (4,3) lc rgb '#cc6677' title 'dissipated'")
}
curves = curves.', '.curve(4, "lw 0.8 dt 1 lc rgb '#004488' title 'work'")
legend_top = top
per_row = columns(10)
top = top + rows(items, per_row) - 1.6
panel_height = narrow ? 84.0 : 112.0
height = top + 2*panel_height + 10 + bottom
set xrange [0:t_end]
do for [form in forms] {
  eval page(form)
  eval key(legend_top, per_row)
  eval bare_x
  set ylabel axis('energy, work', 'J', energy_exponent)
  eval range('y', energy_min, energy_max, energy_exponent)
  eval panel(left, width - right, top, top + panel_height)
  eval curves
  set format x
  set xlabel 't [s]'
  set ylabel axis('balance', 'J', balance_exponent)
  eval range('y', balance_min, balance_max, balance_exponent)
  eval panel(left, width - right, top + panel_height + 10, top + 2*panel_height + 10)
  plot 'energy.dat' using 1:($7/10.0**balance_exponent) with lines lt 1 lw 0.7 notitle
  eval finish
}
