# The costs of methods, from the CSV of work and precision: lines of group, scene, engine, method, unit and processor
# times [ms] for errors of 1e-3, 1e-6 and 1e-9, separated by tabs; "-": no run is that accurate.
#
# The error is the largest error of a length [m], or of an angle [rad] if no lengths are compared.  Times are
# interpolated between levels on logarithmic scales; for an error that the first level reaches, its time counts.
BEGIN { FS = ","; OFS = "\t"; target[1] = 1e-3; target[2] = 1e-6; target[3] = 1e-9 }
NR == 1 { for (i = 1; i <= NF; i++) at[$i] = i; next }
$at["group"] == "original" { next }
{
  key = $at["group"] OFS $at["scene"] OFS $at["engine"] OFS $at["method"]
  if (key != last_key) { if (last_key) finish(); last_error = ""; split("", best); unit = "m" }
  last_key = key
  error = $at["largest_length"]
  if (error == "nan") { error = $at["largest_angle"]; if (error != "nan") unit = "rad" }
  if ($at["status"] != "ok" || error == "nan") { last_error = ""; next }
  cpu = 1e3 * $at["cpu"]
  for (k = 1; k <= 3; k++) {
    cost = cpu
    if (error + 0 > target[k]) continue
    if (last_error != "" && last_error > target[k]) {
      cost = last_cpu * exp(log(cpu / last_cpu) * log(target[k] / last_error) / log(error / last_error))
      if (cost > cpu) cost = cpu
    }
    if (!(k in best) || cost < best[k]) best[k] = cost
  }
  last_error = error + 0
  last_cpu = cpu
}
END { finish() }
function finish(  k, line) {
  line = last_key OFS unit
  for (k = 1; k <= 3; k++) line = line OFS (k in best ? sprintf("%.4g", best[k]) : "-")
  print line
}
