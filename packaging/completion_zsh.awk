# Writes the completion for zsh from the table of list_options.awk.
function quoted(text) {
  gsub(/'/, "\047\134\134\047\047", text)
  gsub(/\[/, "\134\134[", text)
  gsub(/\]/, "\134\134]", text)
  gsub(/:/, "\134\134:", text)
  return text
}
function action(values) { return values == "" ? "_files" : "(" values ")" }
$2 == "command" {
  order[++count] = $1
  about[$1] = quoted($5)
  next
}
$2 == "positional" {
  # Only the first positional argument can have values; all others are files.
  first[$1] = first[$1] == "" ? action($4) : first[$1]
  next
}
{
  rest = $2 == "flag" ? "" : ":value:" action($4)
  names = $3
  if (names ~ /,/) {
    both = names
    gsub(/,/, " ", both)
    specification = sprintf("'(%s)'{%s}'[%s]%s'", both, names, quoted($5), rest)
  } else {
    specification = sprintf("'%s[%s]%s'", names, quoted($5), rest)
  }
  options[$1] = options[$1] " \\\n        " specification
}
END {
  print "#compdef voxdag"
  print "# Completion of voxdag's commands, options and values; other words are file names."
  print "_voxdag() {"
  print "  local -a commands=("
  for (i = 1; i <= count; ++i) printf "    '%s:%s'\n", order[i], about[order[i]]
  print "    'help:print the options of a command'"
  print "  )"
  print "  if (( CURRENT == 2 )); then"
  print "    _describe command commands"
  print "    return"
  print "  fi"
  print "  local command=${words[2]}"
  print "  shift words"
  print "  (( CURRENT-- ))"
  print "  case $command in"
  print "    help) _describe command commands ;;"
  for (i = 1; i <= count; ++i) {
    command = order[i]
    printf "    %s)\n      _arguments%s", command, options[command]
    if (first[command] ~ /^\(/) printf " \\\n        '1:value:%s'", first[command]
    print " \\\n        '*:file:_files'\n      ;;"
  }
  print "  esac"
  print "}"
  print "_voxdag \"$@\""
}
