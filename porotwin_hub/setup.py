from pathlib import Path

from setuptools import find_packages, setup

PACKAGE = 'porotwin_hub'

setup(
    name=PACKAGE,
    version='0.2.0',
    packages=find_packages(exclude=['test']),
    package_data={PACKAGE: ['py.typed', 'launching/*.json']},
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + PACKAGE]),
        ('share/' + PACKAGE, ['package.xml']),
        ('share/' + PACKAGE + '/launch', [str(path) for path in Path('launch').glob('*.py')]),
        ('share/' + PACKAGE + '/config', [str(path) for path in Path('config').iterdir()]),
    ],
    install_requires=['setuptools'],
    extras_require={'test': ['pytest']},
    zip_safe=True,
    license='Apache-2.0',
    entry_points={
        'console_scripts': [
            'hub_node = porotwin_hub.hub_node:main',
            'operator_node = porotwin_hub.operator_node:main',
            'supervisor_node = porotwin_hub.supervisor_node:main',
        ],
    },
)
