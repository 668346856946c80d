from xml.etree import ElementTree

from setuptools import find_packages, setup

PACKAGE = 'porotwin_hub'
ABOUT = ElementTree.parse('package.xml').getroot()

setup(
    name=PACKAGE,
    version=ABOUT.findtext('version'),
    description=ABOUT.findtext('description'),
    maintainer=ABOUT.findtext('maintainer'),
    maintainer_email=ABOUT.find('maintainer').get('email'),
    packages=find_packages(exclude=['test']),
    package_data={PACKAGE: ['py.typed', 'launching/*.json']},
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + PACKAGE]),
        ('share/' + PACKAGE, ['package.xml']),
        ('share/' + PACKAGE + '/config', ['config/small_rig.yaml']),
    ],
    install_requires=['setuptools'],
    extras_require={'test': ['pytest']},
    zip_safe=True,
    license=ABOUT.findtext('license'),
    entry_points={
        'console_scripts': [
            'hub_node = porotwin_hub.hub_node:main',
            'operator_node = porotwin_hub.operator_node:main',
            'supervisor_node = porotwin_hub.supervisor_node:main',
        ],
    },
)
