"""`python -m p3i`: the command line."""

from p3i.cli.main import main

if __name__ == "__main__":  # the processes of `synth --jobs` import this file too
    main()
