"""Runs one node in the foreground of a command, in a process of its own."""

import os
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

import yaml

from porotwin_cli.terminal import WorkFailed
from porotwin_core.basis.parent import PARENT, WRONG_PARAMETERS
from porotwin_core.ros.ros_environment import enter_domain, namespace_of, prepare_environment
from porotwin_hub.launching.graph import NAMESPACE, Parameter


def run_node(
    module: str,
    name: str,
    parameters: dict[str, Parameter],
    *,
    namespace: str = NAMESPACE,
    domain: int | None = None,
) -> None:
    """Run a node until it ends or Ctrl-C reaches it.

    Args:
        module: the module that runs it.
        name: its name.
        parameters: its parameters.
        namespace: its namespace.
        domain: its DDS domain; None: the one of the environment.

    Raises:
        InputError: a variable of ROS, the namespace or the domain is wrong.
        KeyboardInterrupt: Ctrl-C came before the node had started.
        WorkFailed: the node ended with an error, which it has printed.
        SystemExit: with status 2, because a parameter is wrong; the node has printed which.
    """
    enter_domain(domain)
    prepare_environment()
    namespace = namespace_of(namespace)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, f'{name}.yaml')
        file.write_text(yaml.safe_dump({'/**': {'ros__parameters': parameters}}), encoding='utf-8')
        command = [sys.executable, '-P', '-m', module, '--ros-args', '--params-file', str(file)]
        command += ['-r', f'__ns:={namespace}', '-r', f'__node:={name}']
        process = subprocess.Popen(
            command, env={**os.environ, PARENT: str(os.getpid())}, start_new_session=True
        )
        while True:
            try:
                status = process.wait()
                break
            except KeyboardInterrupt:
                process.terminate()  # it closes its files; one that loads ends without a traceback
    if status == -signal.SIGTERM:  # while it loaded its modules
        raise KeyboardInterrupt
    if status == WRONG_PARAMETERS:
        raise SystemExit(WRONG_PARAMETERS)
    if status != 0:
        raise WorkFailed(f'{name} ended with status {status}')
