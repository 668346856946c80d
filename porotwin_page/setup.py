from setuptools import find_packages, setup

PACKAGE = 'porotwin_page'

setup(
    name=PACKAGE,
    version='0.2.0',
    packages=find_packages(exclude=['test']),
    package_data={PACKAGE: ['py.typed', 'web/*', 'panels/*.js']},
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + PACKAGE]),
        ('share/' + PACKAGE, ['package.xml']),
    ],
    install_requires=['setuptools'],
    extras_require={'test': ['pytest']},
    zip_safe=False,
    license='Apache-2.0',
    entry_points={
        'console_scripts': [
            'display_node = porotwin_page.display_node:main',
            'page_node = porotwin_page.page_node:main',
        ],
    },
)
