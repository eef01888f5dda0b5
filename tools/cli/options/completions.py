"""Completions for bash, zsh and fish, from the tables of options."""
import re

BASH = """# Completion of ebpo(1) for bash. Generated from tools/cli/options.
_ebpo()
{
    local word=${COMP_WORDS[COMP_CWORD]} before=${COMP_WORDS[COMP_CWORD - 1]}
    local commands="@COMMANDS@" options= words= values= file=
    # bash splits "--codec=z" into three words
    if [[ $word == = ]]; then
        word=
    elif [[ $before == = && COMP_CWORD -gt 1 ]]; then
        before=${COMP_WORDS[COMP_CWORD - 2]}
    fi
    if ((COMP_CWORD == 1)); then
        COMPREPLY=($(compgen -W "$commands help --version --help" -- "$word"))
        return
    fi
    if [[ ${COMP_WORDS[1]} == help ]]; then
        COMPREPLY=($(compgen -W "$commands remote" -- "$word"))
        return
    fi
    case ${COMP_WORDS[1]} in
@CASES@
    esac
    if [[ -n $words ]]; then
        COMPREPLY=($(compgen -W "$words" -- "$word"))
    elif [[ $word == -* ]]; then
        COMPREPLY=($(compgen -W "$options --help" -- "$word"))
    elif [[ " $values " != *" $before "* ]]; then
        COMPREPLY=($(compgen -f -- "$word"))
    fi
} &&
    complete -o filenames -o bashdefault -F _ebpo ebpo
"""

# Values that are names of files, as --help names them.
FILES = re.compile(r"^(FILE|DIR|PATH|POINTS|WHAT|OUT|.*\.(ply|h5|json|png))$")


def marks(option):
    return [f"--{option.name}"] + [f"-{option.letter}"] * bool(option.letter)


def bash(commands):
    cases = []
    for command in commands:
        options = command.options()
        lines = [f"        {command.name})",
                 '            options="' + " ".join(f"--{o.name}" for o in options) + '"']
        other = [m for o in options if o.value and not o.words and not FILES.match(o.value)
                 for m in marks(o)]
        if other:
            lines.append('            values="' + " ".join(other) + '"')
        worded = [o for o in options if o.words]
        if worded:
            lines.append("            case $before in")
            lines += [f"                {'|'.join(marks(o))}) words=\"{' '.join(o.words)}\" ;;"
                      for o in worded]
            lines.append("            esac")
        cases.append("\n".join(lines + ["            ;;"]))
    names = " ".join(command.name for command in commands)
    return BASH.replace("@COMMANDS@", names).replace("@CASES@", "\n".join(cases))


def zsh_text(text):
    """In single quotes, within an _arguments specification."""
    return re.sub(r"([\[\]:\\])", r"\\\1", text).replace("'", "'\\''")


def zsh_option(option, has_many):
    value = ""
    if option.words:
        value = f":{zsh_text(option.value)}:({' '.join(option.words)})"
    elif option.value:
        action = "_files" if FILES.match(option.value) else " "
        value = f":{zsh_text(option.value)}:{action}"
    many = "*" if has_many else ""
    return [f"        '{many}{mark}[{zsh_text(option.help)}]{value}'" for mark in marks(option)]


def zsh(commands, help_option):
    lines = ["#compdef ebpo", "# Generated from tools/cli/options.", "_ebpo()", "{",
             "    local -a commands options", "    commands=("]
    lines += [f"        '{c.name}:{zsh_text(c.summary)}'" for c in commands]
    lines += ["        'help:describe a command and its options'", "    )",
              "    if (( CURRENT == 2 )); then", "        _describe command commands",
              "        return", "    fi", "    case $words[2] in"]
    for command in commands:
        lines.append(f"    {command.name}) options=(")
        for option in command.options() + [help_option]:
            lines += zsh_option(option, option.kind in ("list", "set"))
        lines.append("    ) ;;")
    lines += ["    help) commands+=('remote:describe the options for URLs')",
              "        _describe command commands; return ;;", "    esac", "    shift words",
              "    (( CURRENT-- ))", "    _arguments -S $options '*:file:_files'", "}", '_ebpo "$@"']
    return "\n".join(lines) + "\n"


def fish_text(text):
    return "'" + text.replace("\\", "\\\\").replace("'", "\\'") + "'"


def fish(commands, help_option):
    lines = ["# Generated from tools/cli/options.",
             "complete -c ebpo -n __fish_use_subcommand -f -a help -d 'describe a command'"]
    for command in commands:
        lines.append(f"complete -c ebpo -n __fish_use_subcommand -f -a {command.name} "
                     f"-d {fish_text(command.summary)}")
    names = " ".join(command.name for command in commands)
    lines.append(f"complete -c ebpo -n '__fish_seen_subcommand_from help' -f -a '{names} remote'")
    for command in commands:
        begin = f"complete -c ebpo -n '__fish_seen_subcommand_from {command.name}'"
        for option in command.options() + [help_option]:
            letter = f" -s {option.letter}" if option.letter else ""
            value = ""
            if option.words:
                value = f" -x -a {fish_text(' '.join(option.words))}"
            elif option.value:
                value = " -r" if FILES.match(option.value) else " -x"
            lines.append(f"{begin}{letter} -l {option.name}{value} -d {fish_text(option.help)}")
    return "\n".join(lines) + "\n"


def make(commands, help_option):
    return (("ebpo.bash", bash(commands)), ("_ebpo", zsh(commands, help_option)),
            ("ebpo.fish", fish(commands, help_option)))
