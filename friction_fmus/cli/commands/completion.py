"""Print the script that makes a shell complete commands, options and names of blocks.

For bash and zsh: eval "$(friction-fmus completion)", also in ~/.bashrc or ~/.zshrc.
"""

import argparse


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    shells = ("bash", "zsh", "fish", "tcsh", "powershell")
    parser.add_argument("shell", nargs="?", choices=shells, default="bash", help="default: bash, also for zsh")


def run(options: argparse.Namespace) -> None:
    """Print the script."""
    import argcomplete.shell_integration

    print(argcomplete.shell_integration.shellcode(["friction-fmus"], shell=options.shell))
