# The costs of methods, from the CSV of work and precision: lines of group, scene, engine, method, unit and the processor times
# [ms] for errors of 1e-3, 1e-6 and 1e-9, separated by tabs; "-": no run is as accurate.
#
# The error is the largest one of lengths [m], where none are compared of angles [rad].  Times are interpolated between
# levels on logarithmic scales; a method that is more accurate at its first level costs the time of that.
BEGIN { FS = ","; OFS = "\t"; target[1] = 1e-3; target[2] = 1e-6; target[3] = 1e-9 }
NR == 1 { for (i = 1; i <= NF; i++) at[$i] = i; next }
$at["group"] == "original" { next }
{
  key = $at["group"] OFS $at["scene"] OFS $at["engine"] OFS $at["method"]
  if (key != last) { if (last) finish(); before = ""; split("", best); unit = "m" }
  last = key
  error = $at["largest_length"]
  if (error == "nan") { error = $at["largest_angle"]; if (error != "nan") unit = "rad" }
  if ($at["status"] != "ok" || error == "nan") { before = ""; next }
  cpu = 1e3 * $at["cpu"]
  for (k = 1; k <= 3; k++) {
    cost = cpu
    if (error + 0 > target[k]) continue
    if (before != "" && before > target[k]) {
      cost = cpu_before * exp(log(cpu / cpu_before) * log(target[k] / before) / log(error / before))
      if (cost > cpu) cost = cpu
    }
    if (!(k in best) || cost < best[k]) best[k] = cost
  }
  before = error + 0
  cpu_before = cpu
}
END { finish() }
function finish(  k, line) {
  line = last OFS unit
  for (k = 1; k <= 3; k++) line = line OFS (k in best ? sprintf("%.4g", best[k]) : "-")
  print line
}
