# Turns the help of a command into lines of tab-separated fields, for the completions:
#
#     COMMAND  KIND  NAMES  VALUES  DESCRIPTION
#
# KIND is "flag", "option" or "positional". NAMES are separated by commas, as in "-r,--resolution". VALUES are the
# words that an option accepts, separated by spaces; "" if the option accepts other values, such as paths.
function flush() {
  if (kind != "" && names != "") printf "%s\t%s\t%s\t%s\t%s\n", command, kind, names, values, text
  kind = names = values = text = ""
}
# Adds the values that a description names: "...: one of a, b, c (default: a)".
function add_values(line,   list) {
  if (match(line, /: (one of|names out of) [^()]*/)) {
    list = substr(line, RSTART, RLENGTH)
    sub(/^: (one of|names out of) /, "", list)
    gsub(/,/, "", list)
    sub(/ +$/, "", list)
    values = list
  } else if (line ~ /a power of two from/) {
    values = "256 512 1k 2k 4k 8k 16k 32k 64k 128k 256k 512k 1M"
  }
}
/^Positionals:/ { flush(); in_positionals = 1; next }
/^[^ ]/ { flush(); in_positionals = 0; next }
# A positional argument or an option.
/^  [-a-z]/ {
  flush()
  line = substr($0, 3)
  names = line
  sub(/ .*/, "", names)
  rest = substr(line, length(names) + 1)
  # The description begins in column 31, or in the next line if the name of the value is long.
  is_long = rest ~ /(Needs|Excludes):( -[^ ]+)+$/ || length($0) < 31 || substr($0, 30, 1) != " " \
            || rest ~ /^ [^ ]*\{[^}]*\}( \[[^]]*\])?( REQUIRED)?$/
  text = is_long ? "" : substr($0, 31)
  type = is_long ? rest : substr($0, 3 + length(names), 28 - length(names))
  gsub(/^ +| +$/, "", type)
  if (type ~ /^(Needs|Excludes)/) type = ""
  kind = in_positionals ? "positional" : type == "" ? "flag" : "option"
  if (match(type, /\{[^}]*\}/)) {
    values = substr(type, RSTART + 1, RLENGTH - 2)
    gsub(/,/, " ", values)
  }
  add_values(text)
  next
}
# Further lines of a description. Lines such as "vox: MagicaVoxel" name a value.
/^                              / {
  line = substr($0, 31)
  if (text == "") { text = line; add_values(line) }
  else if (text ~ /:$/ && match(line, /^[a-z]+: /)) values = values (values == "" ? "" : " ") substr(line, 1, RLENGTH - 2)
}
END { flush() }
