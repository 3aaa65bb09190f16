# Writes the completion for bash from the table of list_options.awk.
$2 == "command" { commands = commands " " $1; next }
$2 == "positional" { if ($4 != "" && !($1 in positional)) positional[$1] = $4; next }
{
  count = split($3, names, ",")
  for (i = 1; i <= count; ++i) options[$1] = options[$1] " " names[i]
  if ($4 != "") { gsub(/,/, "|" $1 " ", $3); values = values sprintf("    \"%s %s\") words=\"%s\" ;;\n", $1, $3, $4) }
}
END {
  gsub(/\|/, "\" | \"", values)
  print "# Completion of voxdag's commands, options and values; other words are file names."
  print "_voxdag() {"
  print "  local word=${COMP_WORDS[COMP_CWORD]} previous=${COMP_WORDS[COMP_CWORD - 1]} words="
  print "  local commands=\"" substr(commands, 2) "\""
  print "  if [ \"$COMP_CWORD\" -eq 1 ]; then"
  print "    words=\"$commands help --help --version\""
  print "  elif [[ ${COMP_WORDS[1]} == help ]]; then"
  print "    words=$commands"
  print "  elif [[ $word == -* ]]; then"
  print "    case ${COMP_WORDS[1]} in"
  count = split(commands, list, " ")
  for (i = 1; i <= count; ++i) printf "      %s) words=\"%s\" ;;\n", list[i], substr(options[list[i]], 2)
  print "    esac"
  print "  else"
  print "    case \"${COMP_WORDS[1]} $previous\" in"
  printf "%s", values
  for (command in positional) printf "    \"%s %s\") words=\"%s\" ;;\n", command, command, positional[command]
  print "    esac"
  print "  fi"
  print "  mapfile -t COMPREPLY < <(compgen -W \"$words\" -- \"$word\")"
  print "}"
  print "complete -o default -F _voxdag voxdag"
}
