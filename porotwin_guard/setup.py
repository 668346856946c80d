from setuptools import find_packages, setup

PACKAGE = 'porotwin_guard'

setup(
    name=PACKAGE,
    version='0.2.0',
    packages=find_packages(exclude=['test']),
    package_data={PACKAGE: ['py.typed']},
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + PACKAGE]),
        ('share/' + PACKAGE, ['package.xml']),
        ('share/' + PACKAGE + '/config', ['config/porotwin.policy.xml']),
    ],
    install_requires=['setuptools'],
    extras_require={'test': ['pytest']},
    zip_safe=False,
    license='Apache-2.0',
    entry_points={'console_scripts': ['guard_node = porotwin_guard.guard_node:main']},
)
