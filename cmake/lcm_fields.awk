# The fields of LCM types with what their comments say, as C++: awk -f lcm_fields.awk A_t.lcm B_t.lcm ...
# For each type a function that shows every field to a visitor: visitor(name, value, sentence).
function finish() {
  if (field == "") return
  gsub(/\\/, "\\\\", comment)
  gsub(/"/, "\\\"", comment)
  print "  visitor(\"" field "\", m." field ", \"" comment "\");"
  field = ""
}
BEGIN {
  print "#pragma once"
  print "// Made by lcm_fields.awk from the LCM types."
  for (i = 1; i < ARGC; ++i) {
    type = ARGV[i]
    sub(/.*\//, "", type)
    sub(/\.lcm$/, "", type)
    print "#include <imuscope/" type ".hpp>"
  }
  print "#include <type_traits>"
  print "namespace imuscope {"
}
FNR == 1 { inside = 0; told = "" }
!inside && /^\/\// { line = $0; sub(/^\/\/ ?/, "", line); told = told == "" ? line : told " " line }
/^struct / {
  inside = 1
  gsub(/\\/, "\\\\", told)
  gsub(/"/, "\\\"", told)
  print "inline const char* sentence_of(const " $2 "*) { return \"" told "\"; }"
  print "inline const char* name_of(const " $2 "*) { return \"" $2 "\"; }"
  print "template <typename M, typename Visitor>"
  print "requires std::is_same_v<std::remove_const_t<M>, " $2 ">"
  print "void visit_fields(M& m, Visitor&& visitor) {"
  next
}
inside && /^}/ { finish(); print "}"; inside = 0; next }
inside && /^ *const / { finish(); next }
inside && /^ *\/\// {
  if (field != "" && match($0, /[^ ]/) > 20) {
    line = $0
    sub(/^ *\/\/ ?/, "", line)
    comment = comment " " line
  }
  next
}
inside && /;/ {
  finish()
  field = $2
  sub(/[;\[].*/, "", field)
  comment = ""
  if (index($0, "//") > 0) { comment = $0; sub(/^[^\/]*\/\/ ?/, "", comment) }
}
END { print "}  // namespace imuscope" }
