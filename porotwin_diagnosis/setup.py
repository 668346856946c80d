from xml.etree import ElementTree

from setuptools import find_packages, setup

PACKAGE = 'porotwin_diagnosis'
ABOUT = ElementTree.parse('package.xml').getroot()

setup(
    name=PACKAGE,
    version=ABOUT.findtext('version'),
    description=ABOUT.findtext('description'),
    maintainer=ABOUT.findtext('maintainer'),
    maintainer_email=ABOUT.find('maintainer').get('email'),
    packages=find_packages(exclude=['test']),
    package_data={PACKAGE: ['py.typed', '**/*.html', '**/*.j2']},
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + PACKAGE]),
        ('share/' + PACKAGE, ['package.xml']),
    ],
    install_requires=['setuptools'],
    extras_require={'test': ['pytest']},
    zip_safe=True,
    license=ABOUT.findtext('license'),
    entry_points={
        'console_scripts': [
            'diagnosis_node = porotwin_diagnosis.diagnosis_node:main',
            'mend_node = porotwin_diagnosis.mend_node:main',
        ],
    },
)
