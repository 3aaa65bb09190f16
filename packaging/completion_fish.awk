# Writes the completion for fish from the table of list_options.awk.
function quoted(text) {
  gsub(/'/, "\134\134\047", text)
  return "'" text "'"
}
BEGIN { print "# Completion of voxdag's commands, options and values; other words are file names." }
$2 == "command" {
  printf "complete -c voxdag -n __fish_use_subcommand -f -a %s -d %s\n", $1, quoted($5)
  names_of_commands = names_of_commands " " $1
  next
}
{
  line = "complete -c voxdag -n '__fish_seen_subcommand_from " $1 "'"
  if ($2 == "positional") {
    if ($4 != "") print line " -f -a " quoted($4)
    next
  }
  count = split($3, names, ",")
  for (i = 1; i <= count; ++i)
    line = line (names[i] ~ /^--/ ? " -l " substr(names[i], 3) : " -s " substr(names[i], 2))
  if ($2 == "option") line = line ($4 == "" ? " -r" : " -x -a " quoted($4))
  print line " -d " quoted($5)
}
END {
  print "complete -c voxdag -n __fish_use_subcommand -f -a help -d 'print the options of a command'"
  print "complete -c voxdag -n '__fish_seen_subcommand_from help' -f -a '" substr(names_of_commands, 2) "'"
}
