from setuptools import find_packages, setup

PACKAGE = 'porotwin_cli'

setup(
    name=PACKAGE,
    version='0.2.0',
    packages=find_packages(exclude=['test']),
    package_data={PACKAGE: ['py.typed'], 'porotwin': ['py.typed']},
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + PACKAGE]),
        ('share/' + PACKAGE, ['package.xml']),
        ('bin', ['scripts/porotwin']),  # on the path once the workspace is sourced
    ],
    install_requires=['setuptools'],
    extras_require={'test': ['pytest']},
    zip_safe=True,
    license='Apache-2.0',
    entry_points={'console_scripts': ['porotwin = porotwin_cli.__main__:main']},
)
