# Doxygen's view of a header: the comment that it begins with is about the file, and about the class that the file is
# named after, which has no comment of its own (sample/clock_map.h: ClockMap; xsens_mt/decoder.h: MtDecoder).
{ line[NR] = $0 }

END {
  stem = FILENAME
  sub(/.*\//, "", stem)
  sub(/\.h$/, "", stem)
  n = split(stem, words, "_")
  for (i = 1; i <= n; ++i) name = name toupper(substr(words[i], 1, 1)) substr(words[i], 2)

  first = 3
  for (last = first; line[last] ~ /^\/\/\//; ++last) {}
  for (i = 1; i <= NR; ++i) {
    if (i == 2 && line[1] == "#pragma once" && line[2] == "") line[2] = "/// @file"
    at_template = line[i] ~ /^template </ && line[i + 1] ~ ("^(class|struct) ([A-Za-z]*)" name "($|[^A-Za-z])")
    at_class = line[i] ~ ("^(class|struct) ([A-Za-z]*)" name "($|[^A-Za-z])") && line[i] !~ /;$/ && line[i - 1] !~ /^template </
    if ((at_template || at_class) && line[i - 1] !~ /^\/\/\// && !told) {
      for (j = first; j < last; ++j) print line[j]
      told = 1
    }
    print line[i]
  }
}
